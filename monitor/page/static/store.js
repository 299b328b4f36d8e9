// What the server has told: the map's layers as last-seen ticks, the newest state, chart, events and links.

const KEEP = -2147483648;
const TERRAIN = -2;
export const NEVER = -1;
const TRAIL = 240;

export class Store {
  /** changed(what): told of each message that was taken in. */
  constructor(changed) {
    this.changed = changed;
    this.reset();
  }

  reset() {
    this.facts = null;
    this.state = null;
    this.layers = new Map();
    this.trail = { first: 0, rows: [] };
    this.series = { k: [], mfow: [], mean: [] };
    this.stalest = 0;
    this.events = [];
    this.bands = [];
    this.links = null;
    this.terrainVersion = 0;
  }

  /** One JSON message. */
  take(says) {
    switch (says.type) {
      case "static":
        this.reset();
        this.facts = says;
        break;
      case "state":
        if (this.facts.live) this.#remember(says);
        this.#shorten(says.k);
        this.state = says;
        if (!says.linked) this.links = null;
        this.stalest = Math.max(this.stalest, says.mfow ?? 0);
        break;
      case "trail":
        this.#join(says);
        break;
      case "series":
        this.series.k.push(...says.k);
        this.series.mfow.push(...says.mfow);
        this.series.mean.push(...says.mean);
        this.stalest = says.mfow.reduce((most, value) => Math.max(most, value ?? 0), this.stalest);
        break;
      case "events":
        this.events.push(...says.events);
        break;
      case "bands":
        this.bands = says.bands;
        break;
      case "links":
        this.links = says;
        break;
    }
    this.changed(says.type, says);
  }

  /** One packet of tiles; see monitor/page/tiles.py. */
  unpack(buffer) {
    const { width, height, side } = this.facts;
    const [number, tick, tiles, runs] = new Int32Array(buffer, 0, 4);
    const ids = new Int32Array(buffer, 16, tiles);
    const counts = new Int32Array(buffer, 16 + 4 * tiles, tiles);
    const values = new Int32Array(buffer, 16 + 8 * tiles, runs);
    const lengths = new Uint16Array(buffer, 16 + 8 * tiles + 4 * runs, runs);
    let map = this.layers.get(number);
    if (map === undefined) {
      map = new Int32Array(width * height).fill(NEVER);
      this.layers.set(number, map);
    }
    const across = Math.ceil(width / side);
    let run = 0;
    for (let i = 0; i < tiles; i++) {
      const row = Math.floor(ids[i] / across) * side, left = (ids[i] % across) * side;
      const right = Math.min(left + side, width);
      let col = left, base = row * width;
      for (const end = run + counts[i]; run < end; run++) {
        const value = values[run];
        let rest = lengths[run];
        while (rest > 0) {
          const part = Math.min(rest, right - col);
          if (value !== KEEP) map.fill(value, base + col, base + col + part);
          col += part;
          rest -= part;
          if (col === right) {
            col = left;
            base += width;
          }
        }
      }
    }
    if (number === TERRAIN) this.terrainVersion++;
    this.changed(number === TERRAIN ? "terrain" : "fog", number);
    return tick;
  }

  get terrain() {
    return this.layers.get(TERRAIN);
  }

  /** A state of a run that goes on is the trail's next row; ticks that were skipped repeat the row before them. */
  #remember({ k, robots }) {
    const { trail } = this;
    const row = robots.flatMap(({ 2: pose }) => (pose ? [pose[0], pose[1]] : [null, null]));
    const end = trail.first + trail.rows.length;
    if (k < end - 1 || k > end + TRAIL / 2) this.trail = { first: k, rows: [row] };
    else {
      while (trail.first + trail.rows.length < k) trail.rows.push(trail.rows.at(-1) ?? row);
      trail.rows[k - trail.first] = row;
    }
  }

  /** Rows of a replay's trail: before those that there are, behind them, or instead of them. */
  #join({ first, rows }) {
    const { trail } = this;
    if (first === trail.first + trail.rows.length) trail.rows.push(...rows);
    else if (first + rows.length === trail.first) this.trail = { first, rows: [...rows, ...trail.rows] };
    else this.trail = { first, rows };
  }

  /** The trail ends with tick k, and has the last so many ticks. */
  #shorten(k) {
    const { trail } = this;
    const from = Math.max(k - TRAIL, trail.first);
    this.trail = { first: from, rows: trail.rows.slice(from - trail.first, Math.max(k + 1 - trail.first, 0)) };
  }
}

const PAUSED = 2;
const NAMES = ["absent", "alive", "paused", "dead", "lost", "left"];

/** How a robot does: {word, kind}; kind: good, warn, bad or off. */
export function standing(robot) {
  const [status, state, , , , heard] = robot;
  if (status === 3 || status === 4) return { word: NAMES[status], kind: "bad" };
  if (status === 0 || status === 5) return { word: NAMES[status], kind: "off" };
  if (status === PAUSED) return { word: "paused", kind: "warn" };
  if (heard !== null && heard > 5) return { word: state ? `${state}, silent` : "silent", kind: "warn" };
  return { word: state || "waiting", kind: state === "dead-end" ? "warn" : "good" };
}

/** Seconds as people read them. */
export function seconds(value) {
  if (value === null || value === undefined) return "-";
  return `${value < 10 ? value.toFixed(1) : Math.round(value)} s`;
}

export function clock(value) {
  const whole = Math.floor(value);
  const two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const rest = `${two(Math.floor((whole % 3600) / 60))}:${two(whole % 60)}`;
  return hours ? `${hours}:${rest}` : rest;
}
