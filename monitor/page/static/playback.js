// The clock of a replay that a page plays by itself, as a server's does (monitor/replay/player.py).

export class Playback {
  /** last: the last tick; step: s per tick; pace: factor of real time; every: ticks from one frame to the next. */
  constructor({ last, step, pace, every = 1 }) {
    Object.assign(this, { last, step, pace, every, place: 0, running: true, asked: performance.now() });
  }

  /** Obey a control of the page. */
  obey({ do: what, factor, k }) {
    this.advance();
    if (what === "pause") this.running = false;
    else if (what === "go") {
      if (this.pace > 0 && this.place >= this.last) this.place = 0;
      this.running = true;
    } else if (what === "step") {
      this.running = false;
      this.#goTo((this.frame + Math.sign(this.pace)) * this.every);
    } else if (what === "pace") this.pace = factor;
    else if (what === "seek") this.#goTo(k);
  }

  /** Advance by the time that has passed. */
  advance() {
    const now = performance.now(), gone = (now - this.asked) / 1000;
    this.asked = now;
    if (!this.running) return;
    this.#goTo(this.place + (gone * this.pace) / this.step);
    if (this.place === (this.pace > 0 ? this.last : 0)) this.running = false;
  }

  /** The number of the frame at the present place: the last one that is not later; at the end the last one of all. */
  get frame() {
    return this.place >= this.last ? Math.ceil(this.last / this.every) : Math.floor(this.place / this.every);
  }

  /** The tick of that frame. */
  get tick() {
    return Math.min(this.frame * this.every, this.last);
  }

  #goTo(k) {
    this.place = Math.min(Math.max(k, 0), this.last);
  }
}
