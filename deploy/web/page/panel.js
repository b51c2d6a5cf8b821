// The column beside the world: who leads and why, the robots, their errors, what happens.

import { button, byId, element, seconds } from "./dom.js";
import { ROLES } from "./model.js";

const WINDOW_S = 60;
const LINES = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a8a8a"];

export class Panels {
  constructor(choose) {
    this.choose = choose;
    this.changed = -1;
    this.model = null;
  }

  show(models, chosen) {
    const model = models[0];
    if (model !== this.model) [this.model, this.changed] = [model, -1];
    const changed = models.reduce((sum, one) => sum + one.changed, 0);
    if (changed !== this.changed) {
      this.changed = changed;
      this.#leads(model);
      this.#log(models);
    }
    this.#robots(model, chosen);
    lease(byId("lease"), model);
    const errors = models.length > 1 ? mean(models) : [...model.errors.entries()].map(([id, rows]) => [id, rows, line(model, id)]);
    const from = Math.max(0, model.t - WINDOW_S);
    chart(byId("distance"), errors, 1, 100, from, model.t);
    chart(byId("bearing"), errors, 2, 180 / Math.PI, from, model.t);
  }

  #leads(model) {
    const items = model.leads.slice(-30).reverse().map((lead) =>
      element("li", {}, element("time", {}, seconds(lead.t)),
        element("span", {}, `robot ${lead.robot} leads, term ${lead.term}`, element("small", {}, lead.why))));
    byId("leads").replaceChildren(...items);
  }

  #log(models) {
    const lines = models.flatMap((model) => model.log.map((line) => [line, model.ground.label]));
    lines.sort(([a], [b]) => a.t - b.t);
    const items = lines.slice(-120).reverse().map(([line, label]) => {
      const who = line.who === null || line.who === undefined ? "" : `robot ${line.who}: `;
      return element("li", { class: line.alarm ? "alarm" : "" }, element("time", {}, seconds(line.t)),
        element("span", {}, `${label ? `${label}: ` : ""}${line.kind === "fault" ? "" : who}${line.text}`));
    });
    byId("log").replaceChildren(...items);
  }

  #robots(model, chosen) {
    const holder = byId("robots");
    const ids = [...model.robots.keys()];
    if (holder.dataset.ids !== ids.join(",") || !holder.firstChild) {
      holder.dataset.ids = ids.join(",");
      this.cells = new Map();
      const body = element("tbody");
      for (const id of ids) {
        const cells = [1, 2, 3, 4, 5].map(() => element("td"));
        const chooser = button(String(id), () => this.choose(id), { "aria-label": `Robot ${id}` });
        chooser.style.borderColor = line(model, id); // the colour of its lines below
        body.append(element("tr", {}, element("td", {}, chooser), ...cells));
        this.cells.set(id, cells);
      }
      const heads = ["", "role", "cm", "°", "m/s", "lost"].map((text) => element("th", {}, text));
      holder.replaceChildren(element("table", {}, element("thead", {}, element("tr", {}, ...heads)), body));
    }
    for (const [id, robot] of model.robots) {
      const [role, distance, bearing, speed, loss] = this.cells.get(id);
      const key = `${robot.role}${robot.cut}`;
      if (role.dataset.role !== key) {
        role.dataset.role = key;
        role.replaceChildren(element("i", { class: `dot ${robot.role}` }), (ROLES[robot.role] ?? robot.role) + (robot.cut ? ", cut off" : ""));
      }
      text(distance, robot.distance === null ? "" : (100 * robot.distance).toFixed(1));
      text(bearing, robot.bearing === null ? "" : ((180 / Math.PI) * robot.bearing).toFixed(1));
      text(speed, robot.speed.toFixed(2));
      text(loss, robot.loss > 0 ? `${Math.round(100 * robot.loss)} %` : "");
      role.parentNode.firstChild.firstChild.setAttribute("aria-pressed", String(id === chosen));
    }
  }
}

function text(cell, value) {
  if (cell.textContent !== value) cell.textContent = value;
}

function line(model, id) {
  return LINES[[...model.robots.keys()].indexOf(id) % LINES.length];
}

// Of two teams side by side: the mean error of each.
function mean(models) {
  return models.map((model, n) => {
    const rows = new Map();
    for (const list of model.errors.values()) {
      for (const [t, distance, bearing] of list) {
        if (distance === null) continue;
        const key = Math.round(t * 10);
        const sum = rows.get(key) ?? [t, 0, 0, 0];
        rows.set(key, [t, sum[1] + Math.abs(distance), sum[2] + Math.abs(bearing), sum[3] + 1]);
      }
    }
    const means = [...rows.values()].map(([t, distance, bearing, count]) => [t, distance / count, bearing / count]);
    return [model.ground.label, means, LINES[n]];
  });
}

function prepared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, width, height);
  const style = getComputedStyle(document.documentElement);
  return [c, width, height, (name) => style.getPropertyValue(`--${name}`).trim()];
}

function chart(canvas, series, column, factor, from, until) {
  const [c, width, height, colour] = prepared(canvas);
  const left = 30;
  let most = 1;
  for (const [, rows] of series) for (const row of rows) if (row[column] !== null && row[0] >= from) most = Math.max(most, Math.abs(row[column] * factor));
  const x = (t) => left + ((t - from) / Math.max(10, until - from)) * (width - left - 4);
  const y = (value) => height / 2 - (value / most) * (height / 2 - 8);
  c.strokeStyle = colour("line");
  c.fillStyle = colour("soft");
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "right";
  c.textBaseline = "middle";
  c.lineWidth = 1;
  for (const value of [most, 0, -most]) {
    c.beginPath();
    c.moveTo(left, y(value));
    c.lineTo(width, y(value));
    c.stroke();
    c.fillText(most < 10 ? value.toFixed(1) : String(Math.round(value)), left - 5, y(value));
  }
  c.lineWidth = series.length > 8 ? 1 : 1.8;
  series.forEach(([name, rows, stroke], n) => {
    c.strokeStyle = stroke;
    c.beginPath();
    let pen = false;
    for (const row of rows) {
      if (row[column] === null || row[0] < from) pen = pen && row[column] !== null;
      else {
        const [px, py] = [x(row[0]), y(row[column] * factor)];
        if (pen) c.lineTo(px, py);
        else c.moveTo(px, py);
        pen = true;
      }
    }
    c.stroke();
    if (typeof name === "string" && name) {
      c.fillStyle = stroke;
      c.textAlign = "left";
      c.fillText(name, left + 6, 10 + 14 * n);
      c.textAlign = "right";
    }
  });
}

function lease(canvas, model) {
  const [c, width, height, colour] = prepared(canvas);
  const until = Math.max(10, model.t);
  const from = Math.max(0, until - 120);
  const x = (t) => ((Math.max(t, from) - from) / (until - from)) * width;
  c.fillStyle = colour("tint");
  c.fillRect(0, 0, width, height);
  c.font = "600 13px system-ui, sans-serif";
  c.textBaseline = "middle";
  c.textAlign = "left";
  model.leads.forEach((lead, n) => {
    const end = model.leads[n + 1]?.t ?? (model.leader === lead.robot ? model.t : Math.min(model.t, lead.t + (lead.ended ?? 0)));
    if (end <= from) return;
    const [x1, x2] = [x(lead.t), Math.max(x(end), x(lead.t) + 2)];
    c.fillStyle = n % 2 ? colour("follower") : colour("leader");
    c.fillRect(x1, 4, x2 - x1, height - 8);
    c.fillStyle = colour("card");
    c.fillRect(x1, 4, 2, height - 8);
    if (x2 - x1 > 18) {
      c.save();
      c.beginPath();
      c.rect(x1, 0, x2 - x1, height);
      c.clip();
      c.fillText(x2 - x1 > 80 ? `robot ${lead.robot}` : String(lead.robot), x1 + 7, height / 2);
      c.restore();
    }
  });
}
