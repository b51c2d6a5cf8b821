// What the page knows of one team: its ground, the newest frames, trails and errors over time.

export const ROLES = { leader: "leads", follower: "follows", waiting: "waits", gone: "gone", stopped: "frozen" };
const KEPT_S = 60;
const TRAIL_STEP_M = 0.1;
const TRAIL_POINTS = 500;
const LOG_LINES = 300;

export function robotOf(row, columns) {
  const robot = {};
  columns.forEach((name, n) => (robot[name] = row[n]));
  return robot;
}

export class Model {
  constructor(ground) {
    this.ground = ground;
    this.robots = new Map();
    this.before = new Map(); // the frame before the newest, to draw in between
    this.t = 0;
    this.leader = null;
    this.term = 0;
    this.moved = new Map();
    this.scans = {};
    this.added = [];
    this.route = ground.route ?? [];
    this.goal = ground.goal;
    this.trails = new Map();
    this.errors = new Map(); // id -> [[t, distance, bearing], ...]
    this.leads = [];
    this.log = [];
    this.plan = null;
    this.tiles = new Map();
    this.arrived = 0;
    this.every = 33;
    this.changed = 0; // counts what the panels show
  }

  frame(frame, at) {
    if (frame.t < this.t) this.forget();
    if (frame.t > this.t || this.robots.size === 0) {
      this.every = 0.8 * this.every + 0.2 * Math.min(250, Math.max(16, at - this.arrived));
      this.arrived = at;
      this.before = this.robots;
    }
    this.t = frame.t;
    this.robots = new Map(frame.robots.map((row) => [row[0], robotOf(row, this.ground.columns)]));
    this.leader = frame.leader;
    this.term = frame.term;
    this.scans = frame.scans ?? {};
    for (const [index, x, y] of frame.moved ?? []) this.moved.set(index, [x, y]);
    for (const robot of this.robots.values()) this.#remember(robot);
  }

  forget() {
    this.before = new Map();
    this.robots = new Map();
    this.trails.clear();
    this.errors.clear();
    this.moved.clear();
  }

  #remember(robot) {
    const trail = this.trails.get(robot.id) ?? [];
    this.trails.set(robot.id, trail);
    const last = trail.at(-1);
    if (!last || Math.hypot(last[0] - robot.x, last[1] - robot.y) > TRAIL_STEP_M) trail.push([robot.x, robot.y]);
    if (trail.length > TRAIL_POINTS) trail.shift();
    const errors = this.errors.get(robot.id) ?? [];
    this.errors.set(robot.id, errors);
    if (errors.length === 0 || this.t > errors.at(-1)[0] + 0.09) errors.push([this.t, robot.distance, robot.bearing]);
    while (errors.length > 0 && errors[0][0] < this.t - KEPT_S) errors.shift();
  }

  news(items) {
    for (const item of items) {
      if (item.k === "lead") this.leads.push(item);
      else if (item.k === "obstacle") this.added.push(item);
      else if (item.k === "route") [this.route, this.goal] = [item.route, item.goal];
      else if (item.k === "plan") this.plan = item.route;
      else if (item.k === "tile") this.tiles.set(`${item.x} ${item.y}`, item);
      else if (item.k === "event") this.log.push(item);
    }
    if (this.log.length > LOG_LINES) this.log.splice(0, this.log.length - LOG_LINES);
    this.changed += items.length;
  }

  // Where a robot is at the time `at` [ms], between the last two frames.
  place(robot, at) {
    const before = this.before.get(robot.id);
    const share = Math.min(1, (at - this.arrived) / this.every);
    if (!before || share >= 1 || Math.hypot(before.x - robot.x, before.y - robot.y) > 2) return robot;
    const turn = Math.atan2(Math.sin(robot.theta - before.theta), Math.cos(robot.theta - before.theta));
    return {
      x: before.x + share * (robot.x - before.x),
      y: before.y + share * (robot.y - before.y),
      theta: before.theta + share * turn,
    };
  }

  // The box around all that stands and drives, in metres.
  bounds() {
    const points = [...this.route, ...(this.goal ? [this.goal] : [])];
    for (const [x1, y1, x2, y2] of this.ground.walls) points.push([x1, y1], [x2, y2]);
    for (const obstacle of this.ground.obstacles) points.push(obstacle.at);
    for (const robot of this.robots.values()) points.push([robot.x, robot.y]);
    if (points.length === 0) points.push([-5, -5], [5, 5]);
    const xs = points.map((p) => p[0]);
    const ys = points.map((p) => p[1]);
    return [Math.min(...xs) - 1, Math.min(...ys) - 1, Math.max(...xs) + 1, Math.max(...ys) + 1];
  }
}
