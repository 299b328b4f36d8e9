// The fog as an image, one pixel a point, row 0 on top. Ages come from last-seen ticks, so the page ages the map itself.

import { AGES, DIFFERENCES, STEPS, themed } from "./colours.js";

const PASSABLE = 1, COUNTED = 2;

export class FogImage {
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.canvas = document.createElement("canvas");
    this.canvas.width = width;
    this.canvas.height = height;
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.image = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.ramp = new Uint32Array(1);
    this.rampFor = "";
  }

  /** What does not change: walls, and what no robot can see. counted: indices of points, from and to by row. */
  base(terrain) {
    const colours = themed();
    const { width, height } = this;
    const from = [], to = [];
    for (let row = 0; row < height; row++) {
      for (let col = 0; col < width; col++) {
        const at = row * width + col, out = (height - 1 - row) * width + col;
        const what = terrain[at];
        if (what & COUNTED) {
          from.push(at);
          to.push(out);
        } else {
          this.pixels[out] = what & PASSABLE ? colours.outside : colours.wall;
        }
      }
    }
    this.from = Int32Array.from(from);
    this.to = Int32Array.from(to);
  }

  /** Ages in ticks at tick k; `oldest` ticks and more are the darkest. */
  ages(seen, k, oldest) {
    const ramp = this.#ramp(AGES, oldest, "ages");
    const { from, to, pixels } = this;
    const last = ramp.length - 1;
    for (let i = 0; i < from.length; i++) {
      const since = seen[from[i]];
      const age = k - (since > 0 ? since : 0);
      pixels[to[i]] = ramp[age < 0 ? 0 : age < last ? age : last];
    }
    this.context.putImageData(this.image, 0, 0);
  }

  /** How much older (orange) or younger (blue) than the truth somebody takes each point to be. */
  difference(believed, truth, k, most) {
    const { from, to, pixels } = this;
    const middle = (STEPS - 1) / 2, share = middle / most;
    for (let i = 0; i < from.length; i++) {
      const at = from[i];
      const older = Math.max(truth[at], 0) - Math.max(believed[at], 0);
      const place = middle + older * share;
      pixels[to[i]] = DIFFERENCES[place < 0 ? 0 : place > STEPS - 1 ? STEPS - 1 : Math.round(place)];
    }
    this.context.putImageData(this.image, 0, 0);
  }

  #ramp(colours, length, name) {
    if (this.rampFor !== `${name} ${length}`) {
      this.rampFor = `${name} ${length}`;
      this.ramp = new Uint32Array(length + 1);
      for (let i = 0; i <= length; i++) this.ramp[i] = colours[Math.round((i / Math.max(length, 1)) * (STEPS - 1))];
    }
    return this.ramp;
  }
}

/** A round number of seconds that is at least `value`. */
export function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1)));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].map((step) => step * power).find((step) => step >= value * 0.999);
}
