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
    this.trails = [];
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
        this.trails = says.robots.map(() => []);
        break;
      case "state":
        this.#trail(says);
        this.state = says;
        this.stalest = Math.max(this.stalest, says.mfow ?? 0);
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

  #trail(next) {
    const last = this.state;
    const jump = last && (next.k < last.k || next.k - last.k > TRAIL / 2);
    next.robots.forEach((robot, place) => {
      const trail = this.trails[place];
      if (jump) trail.length = 0;
      const pose = robot[2];
      const end = trail[trail.length - 1];
      if (pose && (!end || end[0] !== pose[0] || end[1] !== pose[1])) trail.push([pose[0], pose[1], next.k]);
      while (trail.length && trail[0][2] < next.k - TRAIL) trail.shift();
    });
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
