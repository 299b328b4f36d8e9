// The matrix of links: delivered share, or age of the last frame.

import { AGES, themed } from "./colours.js";
import { $, write } from "./dom.js";
import { seconds } from "./store.js";

const ABSENT = 0;
/** The share of the run whose frames may be missing from the counts without a word. */
const IGNORED = 0.01;
const HINT = "rows: senders, columns: receivers";

export class LinksPanel {
  static id = "links";
  static title = "links";
  static topics = ["links", "state", "theme", "open"];
  static html = `
    <label class="lead">show
      <select id="linkwhat">
        <option value="share">delivered share</option>
        <option value="age">age of the last frame</option>
      </select>
    </label>
    <p id="linktip" class="small" aria-live="polite">${HINT}</p>
    <canvas id="matrix" tabindex="0" role="img" aria-describedby="linktip"
      aria-label="Matrix of links, senders by receivers. Arrow keys select a link."></canvas>`;

  constructor({ store }) {
    this.store = store;
    this.canvas = $("matrix");
    this.cell = null;
    $("linkwhat").addEventListener("change", () => this.#draw());
    this.canvas.addEventListener("pointermove", (event) => this.#hover(event));
    this.canvas.addEventListener("pointerleave", () => this.#pointAt(null));
    this.canvas.addEventListener("focus", () => this.#pointAt(this.cell ?? [0, 1]));
    this.canvas.addEventListener("blur", () => this.#pointAt(null));
    this.canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  reset() {}

  update(topic) {
    if (topic !== "state" || !this.store.links) this.#draw();
    if (topic === "links") this.#describe();
  }

  #draw() {
    const { canvas, store } = this;
    if (!store.facts || canvas.parentElement.closest("[hidden]")) return;
    if (canvas.hidden === Boolean(store.links)) {
      canvas.hidden = !store.links;
      this.#describe();
    }
    if (!store.links) return;
    const shown = this.#shown(), n = shown.length, colours = themed();
    const ratio = window.devicePixelRatio || 1, whole = canvas.clientWidth * ratio;
    const label = n <= 16 ? 30 * ratio : 0;
    const side = (whole - label) / n;
    canvas.width = whole;
    canvas.height = whole;
    const c = canvas.getContext("2d");
    c.clearRect(0, 0, whole, whole);
    const share = $("linkwhat").value === "share";
    for (let from = 0; from < n; from++) {
      for (let to = 0; to < n; to++) {
        const value = from === to ? null : share ? this.#share(shown[from], shown[to]) : this.#age(shown[from], shown[to]);
        const x = label + to * side, y = label + from * side, gap = Math.min(1.5 * ratio, side * 0.08);
        c.fillStyle = value === null ? colours.grid : css(share ? 1 - value : Math.min(value / 20, 1));
        if (from !== to || n > 16) c.fillRect(x + gap / 2, y + gap / 2, side - gap, side - gap);
        if (value !== null && n <= 8) {
          const dark = share ? value < 0.5 : value > 10;
          this.#text(c, share ? `${Math.round(100 * value)}` : value.toFixed(value < 10 ? 1 : 0), x + side / 2, y + side / 2, dark ? "#fff" : "#14171b", 11.5 * ratio);
        }
      }
      if (label) {
        const name = shortened(store.facts.robots[shown[from]].name, n > 9 ? 3 : 5);
        this.#text(c, name, label / 2, label + (from + 0.5) * side, colours.muted, 11 * ratio);
        this.#text(c, name, label + (from + 0.5) * side, label / 2, colours.muted, 11 * ratio);
      }
    }
    this.grid = { label, side, shown, ratio };
    if (this.cell) {
      const [row, column] = this.cell;
      c.strokeStyle = colours.ink;
      c.lineWidth = 2 * ratio;
      c.strokeRect(label + column * side + ratio, label + row * side + ratio, side - 2 * ratio, side - 2 * ratio);
    }
  }

  /** Places of the robots that have joined. */
  #shown() {
    return this.store.facts.robots.map((_, place) => place).filter((place) => this.store.state?.robots[place]?.[0] !== ABSENT);
  }

  #share(from, to) {
    const { sent, delivered } = this.store.links, at = from * this.store.facts.robots.length + to;
    return sent[at] > 0 ? delivered[at] / sent[at] : null;
  }

  #age(from, to) {
    const { heard } = this.store.links, tick = heard[from * this.store.facts.robots.length + to];
    return tick < 0 ? null : Math.max(this.store.links.k - tick, 0) * this.store.facts.step;
  }

  #hover(event) {
    if (!this.grid || !this.store.links) return;
    const { label, side, shown, ratio } = this.grid;
    const box = this.canvas.getBoundingClientRect();
    const at = (pixels) => Math.floor((pixels * ratio - label) / side);
    const cell = [at(event.clientY - box.top), at(event.clientX - box.left)];
    if (cell.every((place) => place >= 0 && place < shown.length)) this.#pointAt(cell);
  }

  #key(event) {
    const move = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (!move || !this.cell) return;
    const last = this.#shown().length - 1;
    this.#pointAt(this.cell.map((place, i) => Math.min(Math.max(place + move[i], 0), last)));
    event.preventDefault();
  }

  /** Point at a cell [row, column], or at none (null). */
  #pointAt(cell) {
    const moved = String(cell) !== String(this.cell);
    this.cell = cell;
    this.#describe();
    if (moved) this.#draw();
  }

  /** Describe the cell that is pointed at. */
  #describe() {
    const { store } = this;
    if (!store.facts) return;
    const shown = this.#shown(), [from, to] = (this.cell ?? []).map((place) => shown[place]);
    if (!store.links) return write($("linktip"), unlinked(store.facts));
    if (from === undefined || to === undefined) return write($("linktip"), `${HINT}${countedSince(store)}`);
    const names = store.facts.robots.map((robot) => robot.name);
    if (from === to) return write($("linktip"), `${names[from]}: no link to itself`);
    const at = from * names.length + to, { sent, delivered } = store.links;
    const share = this.#share(from, to), age = this.#age(from, to);
    write($("linktip"), share === null ? `${names[from]} to ${names[to]}: no frames sent`
      : `${names[from]} to ${names[to]}: ${delivered[at]} of ${sent[at]} frames delivered (${(100 * share).toFixed(1)} %)${age === null ? "" : `, the last one ${seconds(age)} ago`}`);
  }

  #text(c, text, x, y, colour, size) {
    c.font = `${size}px system-ui, "DejaVu Sans", sans-serif`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.fillStyle = colour;
    c.fillText(text, x, y);
  }
}

/** From when on frames are counted, as long as it matters to the shares. */
function countedSince({ links: { since, k }, facts: { step } }) {
  return since > IGNORED * k ? `; counted from ${seconds(since * step)} on` : "";
}

/** Why there are no link counts. */
function unlinked({ direct, live, truth }) {
  if (direct && truth) return "unknown with direct radio; the run's summary has the numbers of frames heard";
  return live ? "unknown: without a world nobody reports deliveries" : "computing …";
}

/** A name shortened to `most` characters; the end stays, because it distinguishes robots of one kind. */
function shortened(name, most) {
  return name.length <= most ? name : `${name.slice(0, most - 3)}…${name.slice(-2)}`;
}

/** The colour at a share of the fog's scale. */
function css(share) {
  const value = AGES[Math.round(share * (AGES.length - 1))];
  return `rgb(${value & 255} ${(value >> 8) & 255} ${(value >> 16) & 255})`;
}
