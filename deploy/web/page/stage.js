// One canvas: the world and its robots, with a camera. Drawn anew on every animation frame.

const COLOURS = ["floor", "grid", "wall", "obstacle", "hole", "rise", "route", "leader", "follower", "waiting", "gone", "stopped", "plan", "ink", "card", "soft", "accent"];

export class Stage {
  constructor(holder, model) {
    this.model = model;
    this.canvas = holder.querySelector("canvas");
    this.context = this.canvas.getContext("2d");
    this.holder = holder;
    this.camera = { x: 0, y: 0, scale: 40 };
    this.fitted = false;
    this.touched = false;
    this.following = false;
    this.chosen = null;
    this.sketch = null; // an obstacle that is being drawn: x, y, radius [m]
    this.spot = null; // the point of the ground that was clicked: x, y [m]
    this.colours = {};
    this.readColours();
  }

  readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of COLOURS) this.colours[name] = style.getPropertyValue(`--${name}`).trim();
    this.tileImages = new Map();
  }

  fit() {
    const [x1, y1, x2, y2] = this.model.bounds();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.camera = { x: (x1 + x2) / 2, y: (y1 + y2) / 2, scale: Math.min(width / (x2 - x1), height / (y2 - y1), 160) };
    this.following = false;
    this.touched = false;
  }

  zoom(factor, at = null) {
    const [px, py] = at ?? [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
    const [x, y] = this.toWorld(px, py);
    this.camera.scale = Math.min(600, Math.max(2, this.camera.scale * factor));
    const [nx, ny] = this.toWorld(px, py);
    this.camera.x += x - nx;
    this.camera.y += y - ny;
    this.touched = true;
  }

  pan(dx, dy) {
    this.camera.x -= dx / this.camera.scale;
    this.camera.y += dy / this.camera.scale;
    this.following = false;
    this.touched = true;
  }

  toScreen(x, y) {
    const { x: cx, y: cy, scale } = this.camera;
    return [this.canvas.clientWidth / 2 + (x - cx) * scale, this.canvas.clientHeight / 2 - (y - cy) * scale];
  }

  toWorld(px, py) {
    const { x: cx, y: cy, scale } = this.camera;
    return [cx + (px - this.canvas.clientWidth / 2) / scale, cy - (py - this.canvas.clientHeight / 2) / scale];
  }

  // The robot at a point of the canvas, within a finger's breadth.
  robotAt(px, py) {
    let nearest = null;
    let least = Math.max(18, this.model.ground.radius * this.camera.scale);
    for (const robot of this.model.robots.values()) {
      const [x, y] = this.toScreen(robot.x, robot.y);
      const away = Math.hypot(x - px, y - py);
      if (away < least) [nearest, least] = [robot.id, away];
    }
    return nearest;
  }

  draw(at) {
    const { canvas, context: c, model } = this;
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      if (!this.touched) this.fitted = false;
    }
    if (!this.fitted && model.robots.size > 0 && width > 0) {
      this.fit();
      this.fitted = true;
    }
    const led = model.robots.get(this.chosen ?? model.leader);
    if (this.following && led) [this.camera.x, this.camera.y] = [led.x, led.y];
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = this.colours.floor;
    c.fillRect(0, 0, width, height);
    this.#grid(c, width, height);
    const s = this.camera.scale * ratio;
    c.setTransform(s, 0, 0, -s, ratio * (width / 2) - this.camera.x * s, ratio * (height / 2) + this.camera.y * s);
    this.pixel = 1 / this.camera.scale;
    this.#tiles(c);
    this.#ground(c);
    this.#lines(c, at);
    for (const robot of model.robots.values()) this.#robot(c, robot, at);
    if (this.spot) this.#cross(c, this.spot);
    if (this.sketch) this.#circle(c, this.sketch.x, this.sketch.y, this.sketch.radius, this.colours.accent, 2);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.#names(c, at);
    this.#scale(c, height);
  }

  #grid(c, width, height) {
    const step = this.camera.scale < 12 ? 5 : 1;
    const [x1, y1] = this.toWorld(0, height);
    const [x2, y2] = this.toWorld(width, 0);
    c.strokeStyle = this.colours.grid;
    c.lineWidth = 1;
    c.beginPath();
    for (let x = Math.ceil(x1 / step) * step; x <= x2; x += step) {
      const [px] = this.toScreen(x, 0);
      c.moveTo(Math.round(px) + 0.5, 0);
      c.lineTo(Math.round(px) + 0.5, height);
    }
    for (let y = Math.ceil(y1 / step) * step; y <= y2; y += step) {
      const [, py] = this.toScreen(0, y);
      c.moveTo(0, Math.round(py) + 0.5);
      c.lineTo(width, Math.round(py) + 0.5);
    }
    c.stroke();
  }

  #tiles(c) {
    for (const [key, tile] of this.model.tiles) {
      let image = this.tileImages.get(key);
      if (!image || image.tile !== tile) {
        image = { tile, picture: this.#tileImage(tile) };
        this.tileImages.set(key, image);
      }
      const rows = image.picture.height;
      c.imageSmoothingEnabled = false;
      c.drawImage(image.picture, tile.x, tile.y, tile.columns * tile.cell_m, rows * tile.cell_m);
    }
  }

  #tileImage(tile) {
    const cells = atob(tile.cells);
    const rows = Math.floor(cells.length / tile.columns);
    const picture = document.createElement("canvas");
    picture.width = tile.columns;
    picture.height = rows;
    const c = picture.getContext("2d");
    for (let n = 0; n < rows * tile.columns; n++) {
      const cell = cells.charCodeAt(n);
      if (cell === 0) continue;
      c.globalAlpha = cell === 1 ? 0.18 : 0.75;
      c.fillStyle = cell === 1 ? this.colours.follower : this.colours.wall;
      c.fillRect(n % tile.columns, Math.floor(n / tile.columns), 1, 1);
    }
    return picture;
  }

  #ground(c) {
    const { ground, moved, added, route, goal } = this.model;
    for (const patch of ground.terrain) {
      this.#path(c, patch.outline);
      c.globalAlpha = 0.3;
      c.fillStyle = patch.rises ? this.colours.rise : this.colours.hole;
      c.fill();
      c.globalAlpha = 1;
      this.#stroke(c, patch.rises ? this.colours.rise : this.colours.hole, 1.5);
    }
    if (route.length > 0) {
      c.setLineDash([6 * this.pixel, 6 * this.pixel]);
      c.beginPath();
      route.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y)));
      this.#stroke(c, this.colours.route, 2);
      c.setLineDash([]);
    }
    if (goal) {
      const [x, y] = goal;
      const r = Math.max(0.12, 7 * this.pixel);
      this.#circle(c, x, y, r, this.colours.leader, 2.5);
      this.#circle(c, x, y, r / 2, this.colours.leader, 2.5);
    }
    c.lineCap = "round";
    c.beginPath();
    for (const [x1, y1, x2, y2] of ground.walls) {
      c.moveTo(x1, y1);
      c.lineTo(x2, y2);
    }
    this.#stroke(c, this.colours.wall, 3.5);
    ground.obstacles.forEach((obstacle, n) => {
      const [x, y] = moved.get(n) ?? obstacle.at;
      this.#path(c, obstacle.outline.map(([dx, dy]) => [x + dx, y + dy]));
      c.fillStyle = this.colours.obstacle;
      c.fill();
      this.#stroke(c, this.colours.wall, 1.5);
    });
    for (const obstacle of added) {
      c.beginPath();
      c.arc(obstacle.x, obstacle.y, obstacle.radius_m, 0, 2 * Math.PI);
      c.fillStyle = this.colours.obstacle;
      c.fill();
      this.#stroke(c, this.colours.accent, 2);
    }
  }

  #lines(c, at) {
    const { model } = this;
    if (model.plan && model.plan.length > 1) {
      c.beginPath();
      model.plan.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y)));
      this.#stroke(c, this.colours.plan, 3);
    }
    for (const robot of model.robots.values()) {
      const trail = model.trails.get(robot.id) ?? [];
      c.globalAlpha = 0.35;
      c.beginPath();
      trail.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y)));
      this.#stroke(c, this.#colour(robot), 2);
      c.globalAlpha = 1;
    }
    c.lineWidth = 1.2 * this.pixel;
    for (const robot of model.robots.values()) {
      const ahead = model.robots.get(robot.ahead);
      if (ahead && robot.role === "follower") {
        const [from, to] = [model.place(robot, at), model.place(ahead, at)];
        c.beginPath();
        c.moveTo(from.x, from.y);
        c.lineTo(to.x, to.y);
        this.#stroke(c, this.colours.soft, 1.2);
      }
      if (robot.slot_x !== null && robot.role === "follower") {
        c.setLineDash([3 * this.pixel, 3 * this.pixel]);
        this.#circle(c, robot.slot_x, robot.slot_y, model.ground.radius, this.colours.soft, 1.5);
        c.setLineDash([]);
      }
      const scan = model.scans[robot.id];
      if (scan) this.#scan(c, model.place(robot, at), scan);
    }
  }

  #scan(c, place, [first, step, ranges]) {
    c.fillStyle = this.colours.accent;
    const r = 2 * this.pixel;
    ranges.forEach((range, n) => {
      if (range === 0) return;
      const angle = place.theta + first + n * step;
      c.fillRect(place.x + (range / 100) * Math.cos(angle) - r / 2, place.y + (range / 100) * Math.sin(angle) - r / 2, r, r);
    });
  }

  // Colour tells the role, and so does the shape: a square ring leads, a cross is gone, two bars are frozen.
  #robot(c, robot, at) {
    const radius = Math.max(this.model.ground.radius ?? 0.15, 5 * this.pixel);
    const place = this.model.place(robot, at);
    const colour = this.#colour(robot);
    c.save();
    c.translate(place.x, place.y);
    if (robot.role === "leader") {
      const half = radius * 1.55;
      c.beginPath();
      c.rect(-half, -half, 2 * half, 2 * half);
      this.#stroke(c, colour, 2);
    }
    if (robot.id === this.chosen) this.#circle(c, 0, 0, radius * 1.9, this.colours.accent, 3);
    if (robot.cut) {
      c.setLineDash([2 * this.pixel, 4 * this.pixel]);
      this.#circle(c, 0, 0, radius * 1.6, this.colours.gone, 2.5);
      c.setLineDash([]);
    }
    c.rotate(place.theta);
    c.globalAlpha = robot.role === "gone" ? 0.55 : 1;
    c.beginPath();
    c.arc(0, 0, radius, 0, 2 * Math.PI);
    c.fillStyle = colour;
    c.fill();
    this.#stroke(c, this.colours.card, 1.5);
    c.globalAlpha = 1;
    c.beginPath();
    if (robot.role === "gone") {
      const d = radius * 0.55;
      c.moveTo(-d, -d);
      c.lineTo(d, d);
      c.moveTo(-d, d);
      c.lineTo(d, -d);
      this.#stroke(c, this.colours.card, 2.5);
    } else if (robot.role === "stopped") {
      c.rect(-radius * 0.5, -radius * 0.5, radius * 0.3, radius);
      c.rect(radius * 0.2, -radius * 0.5, radius * 0.3, radius);
      c.fillStyle = this.colours.card;
      c.fill();
    } else {
      c.moveTo(radius * 0.85, 0);
      c.lineTo(-radius * 0.45, radius * 0.55);
      c.lineTo(-radius * 0.2, 0);
      c.lineTo(-radius * 0.45, -radius * 0.55);
      c.closePath();
      c.fillStyle = this.colours.card;
      c.fill();
    }
    c.restore();
  }

  #names(c, at) {
    if (this.camera.scale < 18 && this.model.robots.size > 12) return;
    c.font = "600 13px system-ui, sans-serif";
    c.textAlign = "center";
    c.lineJoin = "round";
    for (const robot of this.model.robots.values()) {
      const place = this.model.place(robot, at);
      const [x, y] = this.toScreen(place.x, place.y);
      const above = y - Math.max(this.model.ground.radius * this.camera.scale, 5) * 1.6 - 6;
      c.strokeStyle = this.colours.floor;
      c.lineWidth = 4;
      c.strokeText(String(robot.id), x, above);
      c.fillStyle = this.colours.ink;
      c.fillText(String(robot.id), x, above);
    }
  }

  #scale(c, height) {
    const metres = this.camera.scale > 90 ? 1 : this.camera.scale > 18 ? 5 : 20;
    const long = metres * this.camera.scale;
    c.strokeStyle = c.fillStyle = this.colours.soft;
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(14, height - 20);
    c.lineTo(14, height - 14);
    c.lineTo(14 + long, height - 14);
    c.lineTo(14 + long, height - 20);
    c.stroke();
    c.font = "12px system-ui, sans-serif";
    c.textAlign = "left";
    c.fillText(`${metres} m`, 20, height - 20);
  }

  #colour(robot) {
    return this.colours[robot.role] ?? this.colours.waiting;
  }

  #path(c, points) {
    c.beginPath();
    points.forEach(([x, y], n) => (n ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.closePath();
  }

  #cross(c, [x, y]) {
    const d = 9 * this.pixel;
    c.beginPath();
    c.moveTo(x - d, y);
    c.lineTo(x + d, y);
    c.moveTo(x, y - d);
    c.lineTo(x, y + d);
    this.#stroke(c, this.colours.accent, 3);
  }

  #circle(c, x, y, radius, colour, width) {
    c.beginPath();
    c.arc(x, y, radius, 0, 2 * Math.PI);
    this.#stroke(c, colour, width);
  }

  #stroke(c, colour, width) {
    c.strokeStyle = colour;
    c.lineWidth = width * this.pixel;
    c.stroke();
  }
}
