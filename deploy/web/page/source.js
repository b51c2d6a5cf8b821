// Where the frames come from: a server that is still running its team, or a recording that lies in the page or beside it.

export class LiveSource {
  constructor(handlers) {
    this.handlers = handlers; // scene, frames, news, answer, lost
    this.number = -1;
    this.tries = 0;
    this.#open();
  }

  #open() {
    const address = new URL("ws", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.search = location.search;
    address.hash = "";
    this.socket = new WebSocket(address);
    this.socket.onmessage = (event) => this.#hear(JSON.parse(event.data));
    this.socket.onopen = () => (this.tries = 0);
    this.socket.onclose = () => {
      if (this.closed) return;
      this.tries += 1;
      this.handlers.lost();
      setTimeout(() => this.#open(), Math.min(5000, 300 * 2 ** this.tries));
    };
  }

  #hear(message) {
    if (message.scene) {
      this.number = message.number;
      this.handlers.scene(message.scene, message.rights, message.viewer);
    } else if (message.frames) {
      if (message.number === this.number) this.handlers.frames(message.frames, message.state);
    } else if (message.news) {
      if (message.number === this.number) this.handlers.news(message.news);
    } else this.handlers.answer(message);
  }

  close() {
    this.closed = true;
    this.socket.close();
  }

  order(order) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(order));
  }
}

// A recording: clips of one or two runs, played on one clock.
export class ClipSource {
  constructor(clip, handlers) {
    this.clip = clip;
    this.handlers = handlers;
    this.t = 0;
    this.playing = false;
    this.speed = 1;
    this.end = Math.max(...clip.panes.map((pane) => pane.frames.at(-1)?.t ?? 0));
    this.told = clip.panes.map(() => 0);
    this.shown = clip.panes.map(() => -1);
    this.last = 0;
    handlers.scene({ ...clip.scene, end: this.end }, "recording", "");
    this.#show(true);
    requestAnimationFrame((at) => this.#tick(at));
  }

  order(order) {
    if (order.do === "play") {
      if (this.t >= this.end) this.seek(0);
      this.playing = true;
    } else if (order.do === "pause") this.playing = false;
    else if (order.do === "step") {
      this.playing = false;
      this.seek(this.t + 0.1);
    } else if (order.do === "speed") this.speed = order.value;
    else if (order.do === "again") this.seek(0);
    else if (order.do === "seek") this.seek(order.value);
    this.#show(false);
  }

  seek(t) {
    this.t = Math.min(this.end, Math.max(0, t));
    this.#show(true);
  }

  #tick(at) {
    if (this.playing && this.last) {
      this.t = Math.min(this.end, this.t + (Math.min(200, at - this.last) / 1000) * this.speed);
      if (this.t >= this.end) this.playing = false;
      this.#show(false);
    }
    this.last = at;
    requestAnimationFrame((next) => this.#tick(next));
  }

  #show(anew) {
    const { panes } = this.clip;
    const at = panes.map((pane) => newest(pane.frames, this.t));
    const news = panes.map((pane, n) => {
      const count = upTo(pane.news, this.t);
      if (anew || count < this.told[n]) this.told[n] = 0;
      const items = pane.news.slice(this.told[n], count);
      this.told[n] = count;
      return items;
    });
    if (anew) this.handlers.anew();
    if (anew) this.#trails(at);
    this.shown = at;
    this.handlers.news(news);
    const state = { playing: this.playing, speed: this.speed, over: "", faults: [], t: this.t, end: this.end };
    this.handlers.frames(panes.map((pane, n) => pane.frames[at[n]]), state);
  }

  // After a jump the trails and errors of the last minute are told again.
  #trails(at) {
    const first = at.map((n) => Math.max(0, n - 600));
    for (let k = 0; k < 600; k += 3) {
      const frames = this.clip.panes.map((pane, n) => pane.frames[Math.min(at[n], first[n] + k)]);
      this.handlers.quiet(frames);
    }
  }
}

function newest(frames, t) {
  let low = 0;
  let high = frames.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (frames[middle].t <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

function upTo(news, t) {
  let count = 0;
  while (count < news.length && (news[count].at ?? 0) <= t) count += 1;
  return count;
}
