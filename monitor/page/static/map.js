// The map: the fog's image under robots with heading, trail, goal and footprint; zoom, pan, hover and clicks.

import { themed } from "./colours.js";
import { FogImage } from "./fogimage.js";
import { drawCross, drawLabels, drawMarks, drawRobots, drawScaleBar, drawStalest, PASSABLE } from "./marks.js";
import { NEVER, OUTSIDE, seconds, certainSince } from "./store.js";

/** By how many pixels of the page a wall's edge surrounds it. */
const EDGE = 1.2;
/** Most points along a side of a pixel of the fog's image. */
const COARSEST = 8;

export class MapView {
  /** callbacks: {hover(text, x, y), redraw(), select(place)} */
  constructor(canvas, store, callbacks) {
    this.canvas = canvas;
    this.store = store;
    this.callbacks = callbacks;
    this.context = canvas.getContext("2d", { alpha: false });
    this.walls = document.createElement("canvas").getContext("2d");
    this.wallsShown = "";
    this.zoom = 1;
    this.centre = null;
    this.shown = { kind: "ages", layers: [0], oldest: 100 };
    this.selected = -1;
    this.placed = null;
    this.inspecting = this.steered = false;
    this.dirtyFog = true;
    this.unseen = false;
    this.pointers = new Map();
    this.hovered = null;
    this.#listen();
  }

  reset() {
    const { width, height } = this.store.facts;
    this.fog = new FogImage(width, height);
    this.colours = themed();
    this.terrainDone = false;
    this.fit();
  }

  restyle() {
    this.colours = themed();
    this.terrainDone = false;
    this.dirtyFog = true;
  }

  fit() {
    const { width, height, point, origin } = this.store.facts;
    this.centre = [origin[0] + (width * point) / 2, origin[1] + (height * point) / 2];
    this.zoom = 1;
  }

  /** Screen pixels of a metre. */
  get scale() {
    const { width, height, point } = this.store.facts;
    return this.zoom * Math.min(this.canvas.width / (width * point), this.canvas.height / (height * point)) * 0.985;
  }

  toScreen(x, y) {
    const scale = this.scale;
    return [this.canvas.width / 2 + (x - this.centre[0]) * scale, this.canvas.height / 2 - (y - this.centre[1]) * scale];
  }

  toWorld(px, py) {
    const scale = this.scale;
    return [this.centre[0] + (px - this.canvas.width / 2) / scale, this.centre[1] - (py - this.canvas.height / 2) / scale];
  }

  /** The index of a place's point, or -1. */
  pointAt(x, y) {
    const { width, height, point, origin } = this.store.facts;
    const col = Math.floor((x - origin[0]) / point), row = Math.floor((y - origin[1]) / point);
    return col >= 0 && row >= 0 && col < width && row < height ? row * width + col : -1;
  }

  draw() {
    const { canvas, context, store } = this;
    const ratio = window.devicePixelRatio || 1;
    const wide = Math.round(canvas.clientWidth * ratio), high = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== high) {
      canvas.width = wide;
      canvas.height = high;
    }
    this.ratio = ratio;
    const well = getComputedStyle(canvas.parentElement).backgroundColor;
    context.fillStyle = well;
    context.fillRect(0, 0, wide, high);
    if (!store.facts || !store.terrain) return;
    this.#paintFog();
    const { point, origin } = store.facts;
    const pixel = this.fog.stride * point, { width, height } = this.fog.canvas;
    const [left, top] = this.toScreen(origin[0], origin[1] + height * pixel);
    context.imageSmoothingEnabled = this.scale * point < 2;
    const place = [left, top, width * pixel * this.scale, height * pixel * this.scale];
    context.drawImage(this.fog.canvas, ...place);
    this.#paintWalls(place, context.imageSmoothingEnabled);
    this.taken = [];
    this.labels = [];
    drawMarks(this);
    drawScaleBar(this);
    if (store.state) {
      drawRobots(this);
      drawStalest(this);
    }
    drawLabels(this);
    if (this.pointing && this.hovered) drawCross(this);
    this.#hover();
  }

  /** The fogs shown; null for one that is being computed. */
  get fogs() {
    return this.shown.layers.map((number) => this.store.fog(number));
  }

  /** How many ticks the fogs shown lag behind the state. */
  get lag() {
    return Math.max(0, ...this.fogs.map((fog) => (fog ? this.store.state.k - fog.tick : 0)));
  }

  #paintFog() {
    const { store, shown } = this, { width, height, point } = store.facts;
    const stride = Math.min(Math.max(Math.floor(1 / (this.scale * point)), 1), COARSEST);
    if (stride !== this.fog.stride) {
      this.fog = new FogImage(width, height, stride);
      this.terrainDone = false;
    }
    const { fog } = this;
    if (!this.terrainDone) {
      fog.base(store.terrain);
      this.wallsShown = "";
      this.terrainDone = true;
      this.dirtyFog = true;
    }
    if (!this.dirtyFog || !store.state) return;
    const fogs = this.fogs;
    this.unseen = false;
    if (fogs.includes(null)) fog.blank();
    else if (shown.kind === "difference") fog.difference(...fogs, shown.oldest);
    else this.unseen = fog.ages(fogs[0], shown.oldest);
    this.dirtyFog = false;
  }

  /** Draw the walls with their edges; anew only where they are elsewhere on the screen than before. */
  #paintWalls(place, smooth) {
    const { canvas, colours } = this, layer = this.walls.canvas;
    const shown = [...place, canvas.width, canvas.height].join();
    if (this.wallsShown !== shown) {
      this.wallsShown = shown;
      layer.width = canvas.width;
      layer.height = canvas.height;
      const { walls: context } = this, [left, top, ...size] = place, reach = EDGE * this.ratio;
      context.imageSmoothingEnabled = smooth;
      for (let i = 0; i < 8; i++) {
        const angle = (i * Math.PI) / 4;
        context.drawImage(this.fog.walls, left + reach * Math.cos(angle), top + reach * Math.sin(angle), ...size);
      }
      context.globalCompositeOperation = "source-in";
      context.fillStyle = colours.edge;
      context.fillRect(0, 0, canvas.width, canvas.height);
      context.globalCompositeOperation = "source-over";
      context.drawImage(this.fog.walls, ...place);
    }
    this.context.drawImage(layer, 0, 0);
  }

  #hover() {
    if (!this.hovered || !this.store.state) return this.callbacks.hover(null);
    const [px, py] = this.hovered;
    const [x, y] = this.toWorld(px * this.ratio, py * this.ratio);
    const at = this.pointAt(x, y);
    if (at < 0) return this.callbacks.hover(null);
    this.callbacks.hover(`${x.toFixed(1)}, ${y.toFixed(1)} m\n${this.#describe(at)}`, px, py);
  }

  #describe(at) {
    const { store, shown } = this;
    const what = store.terrain[at];
    if (!(what & PASSABLE)) return "obstacle";
    if (!(what & 2)) return "not patrolled: no robot sees this point, or it need not be seen";
    const closure = store.shut.get(at), closed = closure ? `${closure} is closed\n` : "";
    const ages = this.fogs.map((fog) => {
      if (!fog) return "computing …";
      const lag = store.state.k - fog.tick;
      return this.#age(fog, at) + (lag > 0 ? ` (as of ${seconds(lag * store.facts.step)} ago)` : "");
    });
    return closed + (shown.kind === "difference" ? `believed: ${ages[0]}\ntrue: ${ages[1]}` : ages[0]);
  }

  /** The age of a point in a fog, at the fog's tick, as text. */
  #age(fog, at) {
    const { step, truth } = this.store.facts;
    const last = fog.seen[at], age = seconds((fog.tick - Math.max(last, 0)) * step);
    if (last === OUTSIDE) return "not patrolled by this robot";
    if (last < certainSince(fog)) {
      const least = seconds((fog.tick - fog.since + 1) * step);
      return `not seen for at least ${least} (known since ${seconds(fog.since * step)})`;
    }
    if (last === NEVER) return truth ? `never seen (${age})` : `not seen in the ${age} since listening began`;
    return `seen ${age} ago`;
  }

  /** The place of the robot at a point of the screen, or -1. */
  #robotAt(px, py) {
    let best = -1, least = 16 * this.ratio;
    (this.store.state?.robots ?? []).forEach(([, , pose], place) => {
      if (!pose) return;
      const [x, y] = this.toScreen(pose[0], pose[1]);
      const reach = Math.hypot(x - px, y - py) - this.store.facts.robots[place].radius * this.scale;
      if (reach < least) {
        least = reach;
        best = place;
      }
    });
    return best;
  }

  /** Show a cross to choose a place, at the pointer or in the middle. placed(x, y): called with it; null: stop. */
  aim(placed) {
    this.#point(placed, this.inspecting);
  }

  /** Show or hide a cross that shows the age of a point. */
  inspect(on) {
    this.#point(this.placed, on);
  }

  /** Whether a place is being chosen. */
  get aiming() {
    return this.placed !== null;
  }

  /** Whether there is a cross. */
  get pointing() {
    return this.aiming || this.inspecting;
  }

  #point(placed, inspecting) {
    if (placed || inspecting) this.hovered ??= [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
    else if (this.pointing && this.steered) this.hovered = null;
    this.placed = placed;
    this.inspecting = inspecting;
    this.steered &&= this.pointing;
    this.callbacks.redraw();
  }

  /** Move the cross by pixels of the page. */
  steer(dx, dy) {
    const [x, y] = this.hovered;
    const within = (value, most) => Math.min(Math.max(value, 0), most - 1);
    this.hovered = [within(x + dx, this.canvas.clientWidth), within(y + dy, this.canvas.clientHeight)];
    this.steered = true;
    this.callbacks.redraw();
  }

  /** Choose the place under the cross. */
  clickHere() {
    this.steered = true;
    this.placed(...this.toWorld(...this.hovered.map((value) => value * this.ratio)));
  }

  zoomAt(factor, px = this.canvas.width / 2, py = this.canvas.height / 2) {
    if (!this.store.facts) return;
    const before = this.toWorld(px, py);
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.5), 60);
    const after = this.toWorld(px, py);
    this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
    this.callbacks.redraw();
  }

  pan(dx, dy) {
    if (!this.store.facts) return;
    this.centre = [this.centre[0] - dx / this.scale, this.centre[1] + dy / this.scale];
    this.callbacks.redraw();
  }

  #listen() {
    const { canvas } = this;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    let moved = 0;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const [x, y] = at(event);
      this.zoomAt(Math.exp(-event.deltaY * 0.0015), x * this.ratio, y * this.ratio);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, at(event));
      moved = 0;
      canvas.classList.add("drag");
    });
    canvas.addEventListener("pointermove", (event) => {
      const here = at(event), before = this.pointers.get(event.pointerId);
      this.hovered = event.pointerType === "touch" && !this.aiming ? null : here;
      if (before) {
        const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
        if (others.length) {
          const [ox, oy] = others[0];
          const factor = Math.hypot(here[0] - ox, here[1] - oy) / Math.max(Math.hypot(before[0] - ox, before[1] - oy), 1);
          this.zoomAt(factor, ox * this.ratio, oy * this.ratio);
        } else {
          this.pan((here[0] - before[0]) * this.ratio, (here[1] - before[1]) * this.ratio);
        }
        moved += Math.hypot(here[0] - before[0], here[1] - before[1]);
        this.pointers.set(event.pointerId, here);
      }
      this.callbacks.redraw();
    });
    const up = (event) => {
      if (!this.pointers.delete(event.pointerId)) return;
      canvas.classList.toggle("drag", this.pointers.size > 0);
      if (event.type === "pointerup" && moved < 4 && this.store.facts) this.#click(...at(event), event.pointerType);
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("pointerleave", () => {
      if (!this.pointing) this.hovered = null;
      this.callbacks.redraw();
    });
  }

  #click(px, py, kind) {
    const x = px * this.ratio, y = py * this.ratio;
    if (this.aiming) return this.placed(...this.toWorld(x, y));
    this.callbacks.select(this.#robotAt(x, y));
    if (kind === "touch") this.hovered = [px, py];
    this.callbacks.redraw();
  }
}
