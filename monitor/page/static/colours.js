// Colours of the map. Cividis looks even and reads the same to colour-blind eyes; fresh is bright, stale is dark.

const CIVIDIS = [
  "fee838", "f8df3c", "efd748", "e6d051", "ddc858", "d4c15f", "ccba64", "c3b369", "bbad6d", "b3a670", "aaa073",
  "a29975", "9a9376", "928d78", "8b8778", "838179", "7c7b78", "757575", "6e6f73", "676a71", "60646f", "595e6e",
  "52596d", "4a536c", "424e6c", "3a486c", "31436d", "263d6e", "18376f", "013271", "002d68", "002859", "00224e",
].map(parse);
const DIFFERENCE = ["0b4f8a", "5aa2d4", "f2f2f0", "f0a04b", "9a3f00"].map(parse);

export const SERIES = ["#0077bb", "#e69f00", "#009e73", "#d55e00", "#b25f97", "#3aa5dd", "#8a6d3b", "#7f7f7f"];
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

/** Never-seen ground: the colour that reports and pictures give it, and dots for those who cannot tell it from grey. */
const NEVER_SEEN = pixel(...parse("b0306a")), NEVER_DOT = pixel(...parse("e59bbf"));

export const AGES = ramp(CIVIDIS);
export const DIFFERENCES = ramp(DIFFERENCE);

export function themed() {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const style = getComputedStyle(document.documentElement);
  const css = (name) => style.getPropertyValue(name).trim();
  return {
    dark,
    wall: dark ? pixel(104, 113, 123) : pixel(116, 123, 132),
    stripe: dark ? pixel(58, 65, 73) : pixel(190, 197, 204),
    never: NEVER_SEEN, dot: NEVER_DOT,
    outside: dark ? pixel(38, 43, 49) : pixel(214, 219, 224),
    ink: css("--ink"), muted: css("--muted"), grid: css("--grid"), card: css("--card"),
    accent: css("--accent"), alert: css("--alert"), warn: css("--warn"),
  };
}
