// The fog as an image, row 0 at the bottom. Ages come from last-seen ticks, so the page ages the map itself.

import { AGES, DIFFERENCES, STEPS, opaque, themed } from "./colours.js";
import { NEVER, OUTSIDE, certainSince } from "./store.js";

const PASSABLE = 1, COUNTED = 2;
/** Points from one stripe to the next where the age is unknown. */
const STRIPE = 4;
/** Points from one row of dots to the next where the ground has never been seen. */
const DOT = 4;
/** The share of the scale within which two ages look alike. */
const ALIKE = 0.05;

export class FogImage {
  /** A pixel covers stride x stride points: it has the colour of the middle one, or is a wall if any of them is. */
  constructor(width, height, stride = 1) {
    this.width = width;
    this.height = height;
    this.stride = stride;
    const wide = Math.ceil(width / stride), high = Math.ceil(height / stride);
    this.canvas = document.createElement("canvas");
    this.canvas.width = wide;
    this.canvas.height = high;
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.walls = document.createElement("canvas");
    this.walls.width = wide;
    this.walls.height = high;
    this.image = this.context.createImageData(wide, high);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.ramp = new Uint32Array(1);
    this.rampFor = "";
  }

  /** Draw what is constant: walls and points that are not patrolled; note index and pixel of the others. */
  base(terrain) {
    const colours = themed();
    const { width, height, stride } = this;
    const { width: wide, height: high } = this.canvas;
    const from = [], to = [], unknown = [], never = [], middle = stride >> 1;
    const wallContext = this.walls.getContext("2d"), wallImage = wallContext.createImageData(wide, high);
    const walls = new Uint32Array(wallImage.data.buffer), wall = opaque(colours.wall);
    // A thin wall must not disappear between the points sampled.
    const isWalled = (top, left) => {
      for (let r = top; r < Math.min(top + stride, height); r++) {
        for (let c = left; c < Math.min(left + stride, width); c++) if (!(terrain[r * width + c] & PASSABLE)) return true;
      }
      return false;
    };
    for (let row = 0; row < high; row++) {
      for (let col = 0; col < wide; col++) {
        const r = Math.min(row * stride + middle, height - 1), c = Math.min(col * stride + middle, width - 1);
        const at = r * width + c, out = (high - 1 - row) * wide + col;
        const what = isWalled(row * stride, col * stride) ? 0 : terrain[at];
        if (what & COUNTED) {
          from.push(at);
          to.push(out);
          unknown.push((row + col) % STRIPE < STRIPE / 2 ? colours.outside : colours.stripe);
          never.push(row % DOT === 0 && col % DOT === (row % (2 * DOT)) / 2 ? colours.dot : colours.never);
        } else {
          this.pixels[out] = what & PASSABLE ? colours.outside : wall;
          if (!(what & PASSABLE)) walls[out] = wall;
        }
      }
    }
    wallContext.putImageData(wallImage, 0, 0);
    this.from = Int32Array.from(from);
    this.to = Int32Array.from(to);
    this.unknown = Uint32Array.from(unknown);
    this.never = Uint32Array.from(never);
  }

  /** Draw all points as unknown. */
  blank() {
    const { to, pixels, unknown } = this;
    for (let i = 0; i < to.length; i++) pixels[to[i]] = unknown[i];
    this.context.putImageData(this.image, 0, 0);
  }

  /**
   * Draw the ages of a fog of the store at its tick; `oldest` ticks and more are darkest. Points last seen before the fog
   * was known are drawn in a colour if all their possible ages look alike, else as unknown. Points certainly never seen
   * are dotted. Returns whether there are any.
   */
  ages(fog, oldest) {
    const ramp = this.#ramp(AGES, oldest, "ages");
    const { from, to, pixels, unknown, never } = this;
    const { seen, tick: k } = fog, least = certainSince(fog), last = ramp.length - 1;
    const earlier = isVague(k - fog.since + 1, k, oldest) ? null : ramp[Math.min(k, last)];
    let unseen = 0;
    for (let i = 0; i < from.length; i++) {
      const since = seen[from[i]], age = k - (since > 0 ? since : 0);
      if (since === NEVER && least === NEVER) {
        pixels[to[i]] = never[i];
        unseen++;
      } else if (since >= least) pixels[to[i]] = ramp[age < last ? age : last];
      else pixels[to[i]] = since === OUTSIDE ? unknown[i] : earlier ?? unknown[i];
    }
    this.context.putImageData(this.image, 0, 0);
    return unseen > 0;
  }

  /**
   * Draw believed minus true age at the belief's tick: older is orange, younger is blue. Points truly seen after that tick
   * are unknown, because the truth does not keep when they were seen before.
   */
  difference(believed, truth, most) {
    const { from, to, pixels, unknown } = this;
    const least = certainSince(believed);
    const middle = (STEPS - 1) / 2, share = middle / most;
    for (let i = 0; i < from.length; i++) {
      const at = from[i];
      const known = believed.seen[at] >= least, seen = Math.max(truth.seen[at], 0);
      const older = seen - (known ? Math.max(believed.seen[at], 0) : 0);
      const vague = seen > believed.tick
        || (!known && (believed.seen[at] === OUTSIDE || isVague(seen - believed.since + 1, seen, most)));
      const place = Math.min(Math.max(Math.round(middle + older * share), 0), STEPS - 1);
      pixels[to[i]] = vague ? unknown[i] : DIFFERENCES[place];
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

/** Whether values from `low` to `high` look different on a scale from -most to most. */
export function isVague(low, high, most) {
  const within = (value) => Math.min(Math.max(value, -most), most);
  return within(high) - within(low) > ALIKE * most;
}

/** A round number of seconds that is at least `value`. */
export function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1)));
  return [1, 1.5, 2, 3, 4, 5, 6, 8, 10].map((step) => step * power).find((step) => step >= value * 0.999);
}
