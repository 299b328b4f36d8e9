// Colours of the map. Cividis looks even and reads the same to colour-blind eyes; fresh is bright, stale is dark.

import { NEVER_DOT, NEVER_SEEN, WALL, WALL_EDGE } from "./palette.js";

const CIVIDIS = [
  "fee838", "f8df3c", "efd748", "e6d051", "ddc858", "d4c15f", "ccba64", "c3b369", "bbad6d", "b3a670", "aaa073",
  "a29975", "9a9376", "928d78", "8b8778", "838179", "7c7b78", "757575", "6e6f73", "676a71", "60646f", "595e6e",
  "52596d", "4a536c", "424e6c", "3a486c", "31436d", "263d6e", "18376f", "013271", "002d68", "002859", "00224e",
].map(parse);
const DIFFERENCE = ["0b4f8a", "5aa2d4", "f2f2f0", "f0a04b", "9a3f00"].map(parse);

export const STEPS = 256;

function parse(hex) {
  return [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

function ramp(stops) {
  const table = new Uint32Array(STEPS);
  for (let i = 0; i < STEPS; i++) {
    const place = (i / (STEPS - 1)) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    const [r, g, b] = stops[low].map((value, c) => Math.round(value + (stops[low + 1][c] - value) * (place - low)));
    table[i] = pixel(r, g, b);
  }
  return table;
}

/** A pixel of ImageData seen as Uint32Array; browsers run on little-endian machines only. */
function pixel(r, g, b, a = 255) {
  return ((a << 24) | (b << 16) | (g << 8) | r) >>> 0;
}

/** A pixel of a colour #rrggbb. */
export function opaque(colour) {
  return pixel(...parse(colour.slice(1)));
}

export const AGES = ramp(CIVIDIS);
export const DIFFERENCES = ramp(DIFFERENCE);

export function themed() {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const style = getComputedStyle(document.documentElement);
  const css = (name) => style.getPropertyValue(name).trim();
  return {
    dark,
    wall: WALL, edge: WALL_EDGE,
    never: opaque(NEVER_SEEN), dot: opaque(NEVER_DOT),
    stripe: opaque(css("--stripe")), outside: opaque(css("--uncounted")),
    mean: css("--mean"), ink: css("--ink"), muted: css("--muted"), grid: css("--grid"), card: css("--card"),
    accent: css("--accent"), alert: css("--alert"), warn: css("--warn"),
  };
}
