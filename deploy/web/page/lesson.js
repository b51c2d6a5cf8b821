// The card of a lesson: the present step, and the protocol's words for what is seen.

import { button, byId, element } from "./dom.js";

export class LessonCard {
  constructor(order) {
    this.order = order;
    this.lesson = null;
    this.step = -1;
  }

  open(lesson) {
    this.lesson = lesson;
    this.step = -1;
    byId("lesson").hidden = !lesson;
  }

  show(step) {
    if (!this.lesson || step === this.step || step === null || step === undefined) return;
    this.step = step;
    const { title, steps } = this.lesson;
    const bars = steps.map((_, n) => element("i", { class: n < step ? "done" : "" }));
    const parts = [element("h2", {}, title), element("div", { class: "steps", role: "img", "aria-label": `${step} of ${steps.length} steps done` }, ...bars)];
    if (step < steps.length) {
      parts.push(element("p", {}, steps[step].says), element("p", { class: "rule" }, steps[step].rule));
      if (steps[step].shows) parts.push(element("div", { class: "row" }, button(step === 0 ? "Play" : "Do it for me", () => this.order({ do: "show" }), { id: "show", class: "primary" })));
    } else parts.push(element("p", { id: "lessondone" }, "Done. Go on playing with this team, or take another lesson."));
    byId("lesson").replaceChildren(...parts);
  }
}
