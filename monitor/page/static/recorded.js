// A run that is part of the page: stands in for the WebSocket of a page's server. What run.js holds:
// monitor/page/saved.py.

import { Playback } from "./playback.js";
import { TRAIL } from "./store.js";

const FRAME_MS = 1000 / 30;

export class RecordedSocket {
  /** text: gzip in base64. */
  constructor(text) {
    this.readyState = WebSocket.CONNECTING;
    this.ready = true;
    this.shown = this.linked = -1;
    this.sent = "";
    this.#load(text);
  }

  /** A message of the page, as to the server. */
  send(text) {
    const message = JSON.parse(text);
    if (message.type === "control") {
      this.playback.obey(message.control);
      this.#post({ type: "answer", id: message.id, done: true, text: "" });
    } else this.ready = true;
  }

  async #load(text) {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const buffer = await new Response(plain).arrayBuffer();
    const length = new DataView(buffer).getUint32(0, true);
    this.run = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let at = 4 + length;
    const cut = (size) => buffer.slice(at, (at += size));
    const terrain = cut(this.run.terrain);
    for (const frame of this.run.frames) {
      frame.changed = cut(frame.changed);
      frame.whole = cut(frame.whole);
    }
    const [facts, ...rest] = this.run.once;
    const { step, ticks } = facts, { every } = this.run, { pace } = this.run.frames[0].state;
    this.playback = new Playback({ last: ticks - 1, step, pace, every });
    this.readyState = WebSocket.OPEN;
    this.#post(facts);
    this.onmessage({ data: terrain });
    for (const message of rest) this.#post(message);
    setInterval(() => this.#show(), FRAME_MS);
  }

  #post(message) {
    this.onmessage({ data: JSON.stringify(message) });
  }

  /** Send what the page lacks, if it has drawn the frame before. */
  #show() {
    this.playback.advance();
    const { frame: number, running, pace, step } = this.playback, { frames, trail, key } = this.run;
    const now = `${number} ${running} ${pace}`;
    if (!this.ready || now === this.sent) return;
    this.ready = false;
    this.sent = now;
    const base = number - (number % key);
    let from = this.shown + 1;
    if (number < this.shown || base > this.shown) {
      this.onmessage({ data: frames[base].whole });
      from = base + 1;
    }
    for (let i = from; i <= number; i++) this.onmessage({ data: frames[i].changed });
    this.shown = number;
    const { state } = frames[number], first = Math.max(state.k - TRAIL, 0);
    this.#post({ type: "trail", first, rows: trail.rows.slice(first, state.k + 1) });
    if (base !== this.linked && frames[base].links) this.#post(frames[base].links);
    this.linked = base;
    this.#post({ ...state, running, pace, rate: running ? Math.abs(pace) / step : 0 });
  }
}
