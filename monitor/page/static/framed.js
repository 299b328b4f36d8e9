// The transport of a page in a frame of pair.html: it follows the clock there. Messages to the pair:
//
//     {type: "replay", name, step, ticks, controls, pace, stalest}    what is known of the run; again when it changes
//     {type: "key", key}     a key that moves the clock
//     {type: "seek", time}   a time that was asked for, s
//
// and from it {type: "time", time} and {type: "scale", stalest, end}, the largest MFoW and the end of both runs, s.

const KEYS = " .,/[]";
/** Pages from the disk have no origin that could be named. */
const ORIGIN = location.protocol === "file:" ? "*" : location.origin;

export class Framed {
  /** operate(control): sends a control; rescale(): called when the scale has changed. */
  constructor(store, operate, rescale) {
    this.store = store;
    this.operate = operate;
    this.rescale = rescale;
    this.told = "";
    document.body.classList.add("framed");
    addEventListener("message", ({ source, data }) => {
      if (source === parent && store.facts) this.#receive(data);
    });
  }

  /** A new source: it does not play by itself. */
  reset() {
    this.told = "";
    this.shown = null;
    if (this.store.facts.controls.includes("pause")) this.operate({ do: "pause" });
  }

  /** A new state, or the curve of MFoW. */
  update() {
    const { facts: { name, step, ticks, controls }, state: { pace }, stalest } = this.store;
    const replay = { type: "replay", name, step, ticks, controls, pace, stalest };
    const text = JSON.stringify(replay);
    if (text !== this.told) this.#tell(replay);
    this.told = text;
  }

  seek(k) {
    this.#tell({ type: "seek", time: k * this.store.facts.step });
  }

  /** Handle a key; returns whether it did. */
  key(key) {
    if (!KEYS.includes(key)) return false;
    this.#tell({ type: "key", key });
    return true;
  }

  #tell(message) {
    parent.postMessage(message, ORIGIN);
  }

  #receive({ type, time, stalest, end }) {
    if (type === "scale") {
      this.store.shared = { stalest, end };
      this.rescale();
    } else if (type === "time") this.#follow(time);
  }

  /** Show a time, or the end of a run that is over by then. One request is under way at a time. */
  async #follow(time) {
    const { ticks, step } = this.store.facts;
    this.wanted = Math.min(Math.floor(time / step + 1e-9), ticks - 1);
    if (this.following) return;
    this.following = true;
    while (this.shown !== this.wanted) {
      const k = this.wanted;
      if (!(await this.operate({ do: "seek", k }))) break;
      this.shown = k;
    }
    this.following = false;
  }
}
