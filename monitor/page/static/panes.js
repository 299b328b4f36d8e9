// The panes beside the map: robots, links, events.

import { SERIES, themed, AGES } from "./colours.js";
import { seconds, standing } from "./store.js";

const ABSENT = 0;

export const $ = (id) => document.getElementById(id);

/** Set a text, unless it is the one that is there: what is live is read out at each change. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export class Robots {
  /** pick(place): told of a chosen row. */
  constructor(store, pick) {
    this.store = store;
    this.pick = pick;
    this.rows = [];
  }

  reset() {
    const body = $("rows");
    body.replaceChildren();
    this.rows = this.store.facts.robots.map((facts, place) => {
      const row = body.insertRow();
      const cells = [0, 1, 2, 3].map(() => row.insertCell());
      const dot = document.createElement("span");
      dot.className = "dot";
      dot.style.background = SERIES[place % SERIES.length];
      const name = document.createElement("button");
      name.type = "button";
      name.textContent = facts.name;
      cells[0].append(dot, name);
      cells[2].className = cells[3].className = "n";
      row.addEventListener("click", () => this.pick(place));
      return { row, cells, said: "" };
    });
  }

  renew(selected) {
    const robots = this.store.state?.robots ?? [];
    robots.forEach((robot, place) => {
      const { row, cells } = this.rows[place];
      const { word, kind } = standing(robot);
      const took = robot[4] === null ? "-" : `${robot[4].toFixed(robot[4] < 10 ? 1 : 0)} ms`;
      const heard = seconds(robot[5]);
      const said = `${word} ${kind} ${took} ${heard} ${selected === place}`;
      if (said === this.rows[place].said) return;
      this.rows[place].said = said;
      cells[1].textContent = word;
      cells[1].className = `s-${kind}`;
      cells[2].textContent = took;
      cells[3].textContent = heard;
      row.classList.toggle("chosen", selected === place);
      cells[0].lastChild.setAttribute("aria-pressed", String(selected === place));
    });
  }
}

export class Links {
  constructor(store) {
    this.store = store;
    this.canvas = $("matrix");
    this.cell = null;
    $("linkwhat").addEventListener("change", () => this.renew());
    this.canvas.addEventListener("pointermove", (event) => this.#hover(event));
    this.canvas.addEventListener("pointerleave", () => this.#at(null));
    this.canvas.addEventListener("focus", () => this.#at(this.cell ?? [0, 1]));
    this.canvas.addEventListener("blur", () => this.#at(null));
    this.canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  renew() {
    const { canvas, store } = this;
    if (!store.facts || canvas.parentElement.closest("[hidden]")) return;
    if (canvas.hidden === Boolean(store.links)) {
      canvas.hidden = !store.links;
      this.#tell();
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

  /** Places of the robots that have been there. */
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
    if (cell.every((place) => place >= 0 && place < shown.length)) this.#at(cell);
  }

  #key(event) {
    const move = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (!move || !this.cell) return;
    const last = this.#shown().length - 1;
    this.#at(this.cell.map((place, i) => Math.min(Math.max(place + move[i], 0), last)));
    event.preventDefault();
  }

  /** Point at a cell, [row, column], or at none. */
  #at(cell) {
    const moved = String(cell) !== String(this.cell);
    this.cell = cell;
    this.#tell();
    if (moved) this.renew();
  }

  /** What the cell that is pointed at stands for. */
  #tell() {
    const { store } = this;
    if (!store.facts) return;
    const shown = this.#shown(), [from, to] = (this.cell ?? []).map((place) => shown[place]);
    if (!store.links) return write($("linktip"), unlinked(store.facts));
    if (from === undefined || to === undefined) return write($("linktip"), "rows send, columns hear");
    const names = store.facts.robots.map((robot) => robot.name);
    if (from === to) return write($("linktip"), `${names[from]}: itself`);
    const at = from * names.length + to, { sent, delivered } = store.links;
    const share = this.#share(from, to), age = this.#age(from, to);
    write($("linktip"), share === null ? `${names[from]} to ${names[to]}: nothing sent`
      : `${names[from]} to ${names[to]}: ${delivered[at]} of ${sent[at]} frames (${(100 * share).toFixed(1)} %), the last ${age === null ? "never" : `${seconds(age)} ago`}`);
  }

  #text(c, text, x, y, colour, size) {
    c.font = `${size}px system-ui, "DejaVu Sans", sans-serif`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.fillStyle = colour;
    c.fillText(text, x, y);
  }
}

/** Why there are no links. */
function unlinked({ direct, live, truth }) {
  if (direct && truth) return "the network carries the frames (direct radio): how many were heard is in the run's summary";
  return live ? "what became of frames is not known here" : "working it out";
}

/** A name in so many letters; its end tells robots of one kind apart. */
function shortened(name, most) {
  return name.length <= most ? name : `${name.slice(0, most - 3)}…${name.slice(-2)}`;
}

/** The colour of a share of the fog's scale. */
function css(share) {
  const value = AGES[Math.round(share * (AGES.length - 1))];
  return `rgb(${value & 255} ${(value >> 8) & 255} ${(value >> 16) & 255})`;
}

const SHOWN = 300;

export class Events {
  constructor(store) {
    this.store = store;
    this.count = -1;
  }

  reset() {
    this.count = -1;
  }

  renew() {
    const { store } = this;
    const now = store.state?.k ?? 0;
    const list = $("list");
    if (this.count !== store.events.length) {
      this.count = store.events.length;
      list.replaceChildren(...store.events.slice(-SHOWN).reverse().map((event) => this.#item(event)));
      if (!this.count) list.append(Object.assign(document.createElement("li"), { textContent: "nothing has happened yet" }));
    }
    if (!store.facts.live) for (const item of list.children) item.classList.toggle("later", Number(item.dataset.k) > now);
  }

  #item([k, kind, robot, detail]) {
    const item = document.createElement("li");
    item.dataset.k = k;
    const when = document.createElement("span");
    when.className = "when";
    when.textContent = seconds(k * this.store.facts.step);
    const what = document.createElement("span");
    const word = document.createElement("b");
    const name = this.store.facts.robots.find((one) => one.number === robot)?.name;
    word.textContent = [name, kind].filter(Boolean).join(" ");
    what.append(word, detail ? ` ${detail}` : "");
    item.append(when, what);
    return item;
  }
}

/** Tabs that arrow keys go through. changed(): another one is open. */
export function tabs(changed) {
  const all = [...document.querySelectorAll("[role=tab]")];
  const open = (tab) => {
    for (const one of all) {
      const chosen = one === tab;
      one.setAttribute("aria-selected", String(chosen));
      one.tabIndex = chosen ? 0 : -1;
      $(one.getAttribute("aria-controls")).hidden = !chosen;
    }
    changed();
  };
  for (const tab of all) {
    tab.addEventListener("click", () => open(tab));
    tab.addEventListener("keydown", (event) => {
      const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!move) return;
      const visible = all.filter((one) => !one.hidden);
      const next = visible[(visible.indexOf(tab) + move + visible.length) % visible.length];
      next.focus();
      open(next);
      event.preventDefault();
    });
  }
}
