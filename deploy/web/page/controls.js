// What can be done: time, faults, formations, tools, keys. Every action is an order to the source of the frames.

import { button, byId, element, say, seconds } from "./dom.js";

const SPEEDS = [[0.1, "0.1 ×"], [0.25, "0.25 ×"], [0.5, "0.5 ×"], [1, "1 ×"], [2, "2 ×"], [5, "5 ×"], [10, "10 ×"], [1000, "as fast as it goes"]];
export const OBSTACLE_M = 0.25;
const SIDES = ["left", "right", "column", "zigzag"];
const ACTIONS = [["kill", "Kill", "K"], ["stop", "Freeze", "S"], ["continue", "Continue", "C"], ["cut", "Cut radio", "X"], ["heal", "Heal radio", "H"], ["restart", "Restart", "R"]];
export const KEYS = [
  ["Space", "play or pause"], [".", "one step"], ["[ ]", "choose a robot"], ["K S C X H R", "kill, freeze, continue, cut, heal, restart it"],
  ["O", "set obstacles down"], ["G", "a goal or an obstacle in the middle of the view"], ["L", "its laser scan"], ["+ − 0", "zoom in, out, show all"], ["arrows", "move the view"], ["F", "follow the leader, or the chosen robot"],
  ["T", "light or dark"], ["Esc", "choose nothing"],
];

export class Controls {
  constructor(page) {
    this.page = page;
    this.tool = "look";
    this.scanned = new Set();
    this.state = {};
  }

  // Builds the controls anew for a scene and the rights of this viewer.
  build(scene, rights) {
    const { page } = this;
    const holder = byId("controls");
    const acts = rights === "operate";
    const timed = scene.engine !== "fleet" && (acts || rights === "recording");
    this.rights = rights;
    this.engine = scene.engine;
    this.play = button("Play", () => page.order({ do: this.state.playing ? "pause" : "play" }), { id: "play", class: "primary" });
    this.clock = element("span", { class: "clock", id: "clock" }, "0.0 s");
    const parts = [];
    if (timed) {
      const speed = element("select", { id: "speed", "aria-label": "Speed", onchange: () => page.order({ do: "speed", value: Number(speed.value) }) },
        ...SPEEDS.map(([value, text]) => element("option", { value, selected: value === 1 }, text)));
      this.speed = speed;
      parts.push(element("div", { class: "group" }, this.play,
        button("Step", () => page.order({ do: "step" }), { id: "step", title: "0.1 s (.)" }),
        button("Again", () => page.order({ do: "again" }), { id: "again", title: "From the start" }), speed));
    }
    parts.push(this.clock);
    this.scrub = null;
    if (rights === "recording") {
      this.scrub = element("input", { type: "range", id: "scrub", min: 0, max: 1, step: 0.01, value: 0, "aria-label": "Time", list: "marks", oninput: () => page.order({ do: "seek", value: Number(this.scrub.value) }) });
      parts.push(element("div", { class: "time" }, this.scrub, this.marks(scene.marks ?? [])));
    }
    if (acts) {
      parts.push(element("div", { class: "group", role: "group", "aria-label": "Formation" },
        ...SIDES.map((side) => button(side, () => this.fault(`formation ${side}`), { id: `side-${side}` }))));
      if (scene.faults !== false) {
        this.loss = this.slider("loss", 0, 1, 0.05, (value) => `${Math.round(100 * value)} %`);
        parts.push(this.loss.label);
        this.range = this.slider("range", 0, 20, 0.5, (value) => (value > 0 ? `${value} m` : "no limit"));
        parts.push(this.range.label);
      }
      if (scene.simulated !== false) {
        this.draw = button("Obstacle", () => this.setTool(this.tool === "draw" ? "look" : "draw"), { id: "draw", "aria-pressed": "false", title: "Click or drag on the ground (O)" });
        parts.push(this.draw);
      }
      if (scene.faults !== false) parts.push(button("Heal all", () => this.fault("heal"), { id: "healall" }));
    }
    holder.replaceChildren(...parts);
    for (const id of ["share", "save"]) byId(id).hidden = !acts || scene.engine !== "virtual";
    byId("stop").hidden = !acts || !scene.stop;
    byId("resume").hidden = true;
    this.scene = scene;
    this.buildOpen(scene, acts);
    this.setTool("look");
  }

  // Elections, contacts, faults and decisions on the time line.
  marks(marks) {
    const end = Math.max(1, this.page.scene.end ?? 1);
    const holder = element("div", { class: "marks", "aria-hidden": "true" });
    for (const [t, kind] of marks) {
      const mark = element("i", { class: kind, title: `${seconds(t)} ${kind}` });
      mark.style.left = `${(100 * t) / end}%`;
      holder.append(mark);
    }
    return holder;
  }

  slider(name, min, max, step, words) {
    const output = element("output", {}, words(0));
    const input = element("input", { type: "range", id: name, min, max, step, value: 0 });
    input.addEventListener("input", () => (output.textContent = words(Number(input.value))));
    input.addEventListener("change", () => this.fault(`${name} ${Number(input.value)}`));
    const set = (value) => {
      if (document.activeElement === input && input.matches(":active")) return;
      if (Number(input.value) !== value) input.value = value;
      output.textContent = words(Number(input.value));
    };
    return { label: element("label", {}, name, input, output), set };
  }

  buildOpen(scene, acts) {
    const { page } = this;
    const holder = byId("open");
    if (!acts || !scene.scenarios) return holder.replaceChildren();
    const scenario = element("select", { id: "scenario", "aria-label": "Scenario", onchange: () => page.order({ do: "open", link: `#run=${encodeURIComponent(scenario.value)}` }) },
      ...scene.scenarios.map((name) => element("option", { value: name, selected: name === scene.scenario }, name)));
    if (!scene.scenarios.includes(scene.scenario)) scenario.prepend(element("option", { value: scene.scenario, selected: true }, scene.scenario));
    const lessons = element("select", { id: "lessons", "aria-label": "Lesson", onchange: () => lessons.value && page.order({ do: "lesson", key: lessons.value }) },
      element("option", { value: "" }, "Lessons"),
      ...scene.lessons.map(([key, title]) => element("option", { value: key, selected: key === scene.lesson?.key }, title)));
    return holder.replaceChildren(lessons, scenario);
  }

  show(state, t) {
    this.state = state;
    this.play.textContent = state.playing ? "Pause" : "Play";
    this.clock.textContent = seconds(state.t ?? t);
    if (this.speed && document.activeElement !== this.speed && SPEEDS.some(([value]) => value === state.speed)) this.speed.value = state.speed;
    this.play.disabled = Boolean(state.over);
    byId("resume").hidden = !state.stopped || this.rights !== "operate";
    if (state.loss !== undefined && this.loss) this.loss.set(state.loss);
    if (state.range !== undefined && this.range) this.range.set(state.range);
    if (this.scrub) {
      this.scrub.max = state.end;
      if (!this.scrub.matches(":active")) this.scrub.value = state.t;
    }
  }

  setTool(tool) {
    this.tool = tool;
    this.draw?.setAttribute("aria-pressed", String(tool === "draw"));
    for (const stage of document.querySelectorAll(".stage")) stage.classList.toggle("drawing", tool === "draw");
    if (tool === "draw") say("Click the ground, or drag for a larger obstacle");
  }

  fault(text) {
    if (this.rights === "operate") this.page.order({ do: "fault", text });
  }

  // The menu of a robot, beside it.
  menu(robot, at) {
    if (robot === null || this.rights !== "operate" || this.scene.faults === false) {
      byId("menu").hidden = true;
      return;
    }
    const actions = ACTIONS.map(([action, text, key]) => button(text, () => this.action(action, robot), { id: `do-${action}`, title: key }));
    const scan = button("Scan", () => this.scan(robot), { id: "do-scan", title: "L", "aria-pressed": String(this.scanned.has(robot)) });
    const close = button("×", () => this.page.choose(null), { "aria-label": "Close" });
    this.#open(at, element("h2", {}, `Robot ${robot}`, close), element("div", { class: "row" }, ...actions, scan));
  }

  // The menu of a point of the ground [m], beside it.
  spotMenu([x, y], at) {
    const place = `${x.toFixed(2)},${y.toFixed(2)}`;
    const then = (text) => () => {
      this.page.choose(null);
      this.fault(text);
    };
    const goal = button("Goal here", then(`goal ${place}`), { id: "do-goal" });
    const obstacle = this.draw ? button("Obstacle here", then(`obstacle ${place},${OBSTACLE_M}`), { id: "do-obstacle" }) : "";
    const close = button("×", () => this.page.choose(null), { "aria-label": "Close" });
    this.#open(at, element("h2", {}, `${x.toFixed(2)}, ${y.toFixed(2)} m`, close), element("div", { class: "row" }, goal, obstacle));
  }

  #open(at, ...parts) {
    const menu = byId("menu");
    menu.replaceChildren(...parts);
    menu.hidden = false;
    const { width, height } = byId("stages").getBoundingClientRect();
    menu.style.left = `${Math.max(8, Math.min(at[0] + 24, width - 246))}px`;
    menu.style.top = `${Math.max(8, Math.min(at[1] - 40, height - menu.offsetHeight - 8))}px`;
  }

  action(action, robot) {
    this.fault(`${action} ${robot}`);
    this.page.choose(null);
  }

  scan(robot) {
    const on = !this.scanned.has(robot);
    if (on) this.scanned.add(robot);
    else this.scanned.delete(robot);
    this.page.order({ do: "scan", robot, on });
    byId("do-scan")?.setAttribute("aria-pressed", String(on));
  }

  key(event) {
    const { page } = this;
    const stage = page.stages[0];
    const chosen = page.chosen;
    const action = ACTIONS.find(([, , letter]) => letter.toLowerCase() === event.key.toLowerCase());
    if (event.ctrlKey || event.metaKey || event.altKey || !stage) return false;
    if (event.key === " ") page.order({ do: this.state.playing ? "pause" : "play" });
    else if (event.key === ".") page.order({ do: "step" });
    else if (event.key === "+" || event.key === "=") page.stages.forEach((one) => one.zoom(1.25));
    else if (event.key === "-") page.stages.forEach((one) => one.zoom(0.8));
    else if (event.key === "0") page.stages.forEach((one) => one.fit());
    else if (event.key === "ArrowLeft") stage.pan(60, 0);
    else if (event.key === "ArrowRight") stage.pan(-60, 0);
    else if (event.key === "ArrowUp") stage.pan(0, 60);
    else if (event.key === "ArrowDown") stage.pan(0, -60);
    else if (event.key === "f") page.follow();
    else if (event.key === "t") page.theme();
    else if (event.key === "?") byId("keys").showModal();
    else if (event.key === "Escape") page.choose(null);
    else if (event.key === "g") page.spot(stage, [stage.camera.x, stage.camera.y], true);
    else if (event.key === "o" && this.draw) this.setTool(this.tool === "draw" ? "look" : "draw");
    else if (event.key === "l" && chosen !== null && this.rights === "operate") this.scan(chosen);
    else if (event.key === "]" || event.key === "[") page.next(event.key === "]" ? 1 : -1);
    else if (action && chosen !== null) this.action(action[0], chosen);
    else return false;
    return true;
  }
}
