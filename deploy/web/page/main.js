// The page: joins source, models, stages, panels and controls.

import { KEYS, OBSTACLE_M, Controls } from "./controls.js";
import { byId, element, say } from "./dom.js";
import { LessonCard } from "./lesson.js";
import { Model } from "./model.js";
import { Panels } from "./panel.js";
import { ClipSource, LiveSource } from "./source.js";
import { Stage } from "./stage.js";

const PANELS_MS = 120;
const DRAG_PX = 6;

class Page {
  constructor() {
    this.models = [];
    this.stages = [];
    this.chosen = null;
    this.state = {};
    this.controls = new Controls(this);
    this.lesson = new LessonCard((order) => this.order(order));
    this.panels = new Panels((id) => this.choose(id));
    this.panelsAt = 0;
    this.opened = false;
    this.fps = { count: 0, since: performance.now(), value: 0 };
    this.#wire();
    requestAnimationFrame((at) => this.#draw(at));
  }

  start() {
    const handlers = {
      scene: (scene, rights, viewer) => this.#scene(scene, rights, viewer),
      frames: (frames, state) => this.#frames(frames, state),
      quiet: (frames) => frames.forEach((frame, n) => this.models[n].frame(frame, performance.now())),
      news: (news) => news.forEach((items, n) => this.models[n]?.news(items)),
      anew: () => this.#models(),
      answer: (answer) => this.#answer(answer),
      lost: () => say("The server does not answer: trying again", true),
    };
    const clip = document.getElementById("clip");
    if (clip) this.source = new ClipSource(JSON.parse(clip.textContent), handlers);
    else this.source = new LiveSource(handlers);
    this.handlers = handlers;
  }

  order(order) {
    this.source?.order(order);
  }

  // A server that has a recording says so, and the clip is played here.
  async #recording() {
    this.source.close();
    const got = await fetch(`clip.json${location.search}`);
    this.source = new ClipSource(await got.json(), this.handlers);
  }

  #scene(scene, rights, viewer) {
    if (scene.engine === "recording" && rights !== "recording") return void this.#recording();
    Object.assign(this, { scene, rights, viewer });
    document.title = `lfa: ${scene.title}`;
    byId("title").textContent = scene.title;
    this.#stages();
    this.#models();
    this.controls.build(scene, rights);
    this.lesson.open(scene.lesson);
    this.choose(null);
    this.ended = false;
    const link = location.hash.slice(1);
    if (!this.opened && rights === "operate" && link.includes("run=")) this.order({ do: "open", link: `#${link}` });
    this.opened = true;
  }

  #stages() {
    const holders = this.scene.panes.map((pane) => element("div", { class: "stage" },
      element("canvas", { role: "img", tabindex: "0", "aria-label": `The world seen from above${pane.label ? `: ${pane.label}` : ""}` }),
      ...(pane.label ? [element("span", { class: "label" }, pane.label)] : [])));
    byId("stages").replaceChildren(...holders);
    this.stages = holders.map((holder, n) => {
      const stage = new Stage(holder, new Model(this.scene.panes[n]));
      this.#pointer(stage);
      return stage;
    });
  }

  #models() {
    this.models = this.scene.panes.map((pane) => new Model(pane));
    this.stages.forEach((stage, n) => {
      stage.model = this.models[n];
      stage.readColours();
    });
  }

  #frames(frames, state) {
    const now = performance.now();
    frames.forEach((frame, n) => frame && this.models[n]?.frame(frame, now));
    this.state = state;
    this.controls.show(state, this.models[0].t);
    this.lesson.show(state.step);
    if (state.over && !this.ended) {
      this.ended = true;
      say(`The run is over: ${state.over.replaceAll("_", " ")}`);
    }
  }

  #answer(answer) {
    if (answer.refused) say(answer.refused, true);
    else if (answer.said) say(answer.said);
    else if (answer.saved) this.#download(answer.name, answer.saved);
  }

  #download(name, text) {
    const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: "application/toml" })), download: name });
    link.click();
    URL.revokeObjectURL(link.href);
    say(`${name}: lfa sim runs it again to the same events`);
  }

  choose(id) {
    this.chosen = id;
    for (const stage of this.stages) [stage.chosen, stage.spot] = [id, null];
    const robot = this.models[0]?.robots.get(id);
    this.controls.menu(robot ? id : null, robot ? this.stages[0].toScreen(robot.x, robot.y) : [0, 0]);
  }

  // A point of the ground was clicked: once to choose no robot, then to do something there.
  spot(stage, [x, y], byKey = false) {
    const again = this.chosen !== null || this.stages.some((one) => one.spot);
    this.choose(null);
    if (again || this.rights !== "operate") return;
    stage.spot = [x, y];
    this.controls.spotMenu(stage.spot, stage.toScreen(x, y));
    if (byKey) byId("do-goal").focus();
  }

  next(step) {
    const ids = [...(this.models[0]?.robots.keys() ?? [])];
    const at = ids.indexOf(this.chosen);
    if (ids.length > 0) this.choose(ids[(at + step + ids.length + (at < 0 && step < 0 ? 1 : 0)) % ids.length]);
  }

  follow() {
    const on = !this.stages[0]?.following;
    this.stages.forEach((stage) => (stage.following = on));
  }

  theme(to = null) {
    const root = document.documentElement;
    root.dataset.theme = to ?? (root.dataset.theme === "dark" ? "light" : "dark");
    this.stages.forEach((stage) => stage.readColours());
  }

  #wire() {
    this.theme(window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    byId("theme").onclick = () => this.theme();
    byId("help").onclick = () => byId("keys").showModal();
    byId("zoomin").onclick = () => this.stages.forEach((stage) => stage.zoom(1.25));
    byId("zoomout").onclick = () => this.stages.forEach((stage) => stage.zoom(0.8));
    byId("fit").onclick = () => this.stages.forEach((stage) => stage.fit());
    byId("follow").onclick = () => this.follow();
    byId("save").onclick = () => this.order({ do: "save" });
    byId("resume").onclick = () => this.order({ do: "resume" });
    byId("stop").onclick = () => this.order({ do: "stop" });
    byId("share").onclick = () => this.share();
    byId("keylist").replaceChildren(...KEYS.flatMap(([key, what]) => [element("span", {}, element("kbd", {}, key)), element("span", {}, what)]));
    document.addEventListener("keydown", (event) => {
      if (event.target.closest("input, select, dialog") || (event.key === " " && event.target.closest("button"))) return;
      if (this.controls.key(event)) event.preventDefault();
    });
  }

  // The link of the run as it is now; for those who may only look the address says so.
  share() {
    const link = `${location.origin}${location.pathname}?token=${this.viewer}#${this.state.link}`;
    history.replaceState(null, "", `#${this.state.link}`);
    navigator.clipboard?.writeText(link).then(() => say("The link of this run is copied"), () => say(link));
  }

  #pointer(stage) {
    const { canvas } = stage;
    const fingers = new Map();
    let moved = 0;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, at(event));
      moved = 0;
      if (this.controls.tool === "draw") {
        const [x, y] = stage.toWorld(...at(event));
        stage.sketch = { x, y, radius: OBSTACLE_M };
      }
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const [px, py] = at(event);
      moved += Math.hypot(px - before[0], py - before[1]);
      const others = [...fingers.entries()].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      if (stage.sketch) {
        const [x, y] = stage.toWorld(px, py);
        stage.sketch.radius = Math.min(5, Math.max(OBSTACLE_M, Math.hypot(x - stage.sketch.x, y - stage.sketch.y)));
      } else if (others.length > 0) {
        const apart = ([x, y]) => Math.hypot(x - others[0][0], y - others[0][1]);
        stage.zoom(apart([px, py]) / Math.max(1, apart(before)), others[0]);
      } else if (moved > DRAG_PX) stage.pan(px - before[0], py - before[1]);
      fingers.set(event.pointerId, [px, py]);
    });
    const up = (event) => {
      if (!fingers.delete(event.pointerId)) return;
      const place = at(event);
      if (stage.sketch) this.#setDown(stage);
      else if (moved <= DRAG_PX && event.type === "pointerup") this.#touch(stage, place);
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      stage.zoom(Math.exp(-event.deltaY * 0.0015), at(event));
    }, { passive: false });
  }

  #touch(stage, place) {
    const robot = stage.robotAt(...place);
    if (robot === null) this.spot(stage, stage.toWorld(...place));
    else this.choose(robot);
  }

  #setDown(stage) {
    const { x, y, radius } = stage.sketch;
    stage.sketch = null;
    this.controls.fault(`obstacle ${x.toFixed(2)},${y.toFixed(2)},${radius.toFixed(2)}`);
  }

  #draw(at) {
    const now = performance.now();
    this.stages.forEach((stage) => stage.draw(now));
    if (at - this.panelsAt > PANELS_MS && this.models.length > 0) {
      this.panelsAt = at;
      this.panels.show(this.models, this.chosen);
      byId("follow").setAttribute("aria-pressed", String(Boolean(this.stages[0]?.following)));
    }
    this.fps.count += 1;
    if (now - this.fps.since > 1000) {
      this.fps.value = (1000 * this.fps.count) / (now - this.fps.since);
      this.fps.count = 0;
      this.fps.since = now;
    }
    requestAnimationFrame((next) => this.#draw(next));
  }
}

const page = new Page();
window.lfa = page; // for the console, and for tests
page.start();
