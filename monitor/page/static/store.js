// What the server has sent: the map's layers as last-seen ticks, the newest state, chart, events and links.

const KEEP = -2147483648;
const TERRAIN = -2;
/** Replace a last-seen tick: not seen yet; not patrolled by the robot whose fog it is. */
export const NEVER = -1, OUTSIDE = -2;
/** Most ticks of the chart; beyond them every other one is dropped. */
const MOST_TICKS = 10000;
/** Ticks of a trail; hub.py has the same number. */
export const TRAIL = 240;

export class Store {
  /** changed(topic, message): called after each message. */
  constructor(changed) {
    this.changed = changed;
    /** Of two replays side by side: the largest MFoW and the end of both, s. */
    this.shared = { stalest: 0, end: 0 };
    this.reset();
  }

  reset() {
    this.facts = null;
    this.state = null;
    this.layers = new Map();
    this.held = [];
    this.trail = { first: 0, rows: [] };
    this.series = { k: [], mfow: [], mean: [] };
    this.stalest = 0;
    this.events = [];
    this.bands = [];
    this.links = null;
    this.shut = new Map();
    this.closed = "";
  }

  /** One JSON message. */
  receive(message) {
    switch (message.type) {
      case "static":
        this.reset();
        this.facts = message;
        break;
      case "state":
        if (this.facts.live) this.#remember(message);
        this.#shorten(message.k);
        this.state = message;
        this.#close(Object.values(message.looks ?? {}).flatMap((looks) => Object.keys(looks).filter((name) => looks[name][2])));
        for (const packet of this.held.splice(0)) this.#fill(packet);
        if (!message.linked) this.links = null;
        this.stalest = Math.max(this.stalest, message.mfow ?? 0);
        break;
      case "trail":
        this.#join(message);
        break;
      case "series":
        this.#lengthen(message);
        break;
      case "events":
        this.events.push(...message.events);
        break;
      case "bands":
        this.bands = message.bands;
        break;
      case "links":
        this.links = message;
        break;
    }
    this.changed(message.type, message);
  }

  /** One packet of tiles; see monitor/page/maps.py. The packet of a fog belongs to the state that follows it. */
  unpack(buffer) {
    if (new Int32Array(buffer, 0, 1)[0] !== TERRAIN) return this.held.push(buffer);
    this.#fill(buffer);
    this.changed("terrain");
  }

  /** A fog {seen, since, tick} of the newest state or a few ticks before it; null while it is being computed. */
  fog(number) {
    const layer = this.layers.get(number), lag = this.state?.k - layer?.tick;
    return lag >= 0 && lag <= this.facts.late ? layer : null;
  }

  #fill(buffer) {
    const { width, height, side } = this.facts;
    const [number, tick, since, tiles, runs] = new Int32Array(buffer, 0, 5);
    const ids = new Int32Array(buffer, 20, tiles);
    const counts = new Int32Array(buffer, 20 + 4 * tiles, tiles);
    const values = new Int32Array(buffer, 20 + 8 * tiles, runs);
    const lengths = new Uint16Array(buffer, 20 + 8 * tiles + 4 * runs, runs);
    const map = this.layers.get(number)?.seen ?? new Int32Array(width * height).fill(NEVER);
    this.layers.set(number, { seen: map, tick, since });
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
  }

  /** Note the points of the marks that are filled, each with its name: they are closed. */
  #close(names) {
    if (this.closed === String(names)) return;
    this.closed = String(names);
    this.shut.clear();
    for (const { name, runs } of this.facts.marks) {
      if (!runs.length || !names.includes(name)) continue;
      for (const [first, count] of runs) for (let at = first; at < first + count; at++) this.shut.set(at, name);
    }
  }

  /** Places of the robots to list: all but the spare ones that have not joined. */
  get listed() {
    return this.facts.robots.flatMap(({ spare }, place) => (spare && !this.state?.robots[place]?.[0] ? [] : [place]));
  }

  /** The largest MFoW that scales have room for, s. */
  get oldest() {
    return Math.max(this.stalest, this.shared.stalest);
  }

  get terrain() {
    return this.layers.get(TERRAIN)?.seen;
  }

  /** Add to the chart. When it grows too long, of each two ticks the one with the smaller MFoW is dropped, not the last. */
  #lengthen({ k, mfow, mean }) {
    const { series } = this;
    for (let i = 0; i < k.length; i++) {
      series.k.push(k[i]);
      series.mfow.push(mfow[i]);
      series.mean.push(mean[i]);
      this.stalest = Math.max(this.stalest, mfow[i] ?? 0);
    }
    if (series.k.length <= MOST_TICKS) return;
    const kept = [];
    const last = series.k.length - 1;
    for (let i = 0; i <= last; i += 2) kept.push(series.mfow[i + 1] > series.mfow[i] ? i + 1 : i);
    if (kept.at(-1) < last) kept.push(last);
    for (const name of Object.keys(series)) series[name] = kept.map((i) => series[name][i]);
  }

  /** The state of a live fleet is the trail's next row; skipped ticks repeat the row before. */
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

  /** Rows of a replay's trail: before the present ones, after them, or instead of them. */
  #join({ first, rows }) {
    const { trail } = this;
    if (first === trail.first + trail.rows.length) trail.rows.push(...rows);
    else if (first + rows.length === trail.first) this.trail = { first, rows: [...rows, ...trail.rows] };
    else this.trail = { first, rows };
  }

  /** Cut the trail to the last ticks up to k. */
  #shorten(k) {
    const { trail } = this;
    const from = Math.max(k - TRAIL, trail.first);
    this.trail = { first: from, rows: trail.rows.slice(from - trail.first, Math.max(k + 1 - trail.first, 0)) };
  }
}

const ALIVE = 1, PAUSED = 2;
const NAMES = ["absent", "alive", "paused", "dead", "lost", "left"];

/** The status of a robot as {word, kind}; kind: good, warn, bad or off. */
export function robotStatus(robot) {
  const [status, state, , , , heard, trapped] = robot;
  if (status === 3 || status === 4) return { word: NAMES[status], kind: "bad" };
  if (status === 0 || status === 5) return { word: NAMES[status], kind: "off" };
  if (status === PAUSED) return { word: state.startsWith("stopped") ? state : "paused", kind: "warn" };
  if (status === ALIVE && trapped) return { word: `trapped since ${trapped[1] ? "" : "before "}${seconds(trapped[0])}`, kind: "bad" };
  if (heard !== null && heard > 5) return { word: state ? `${state}, silent` : "silent", kind: "warn" };
  return { word: state || "waiting", kind: state === "dead-end" ? "warn" : "good" };
}

/** The first last-seen tick that is certain; points last seen before the fog was known may have been seen later. */
export function certainSince({ since }) {
  return since || NEVER;
}

/** The age of the stalest point as text. */
export function stalestAge([, , age, everSeen]) {
  return everSeen ? seconds(age) : `never seen, ${seconds(age)}`;
}

/** Seconds as text. */
export function seconds(value) {
  if (value === null || value === undefined) return "-";
  return `${value < 10 ? value.toFixed(1) : Math.round(value)} s`;
}

/** A time such as 90, 1:30 or 1:02:03 in s; null for anything else. */
export function timeOf(text) {
  return /^\d+(:\d+){0,2}(\.\d+)?$/.test(text ?? "") ? text.split(":").reduce((sum, part) => 60 * sum + Number(part), 0) : null;
}

export function clock(value) {
  const whole = Math.floor(value);
  const two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  const rest = `${two(Math.floor((whole % 3600) / 60))}:${two(whole % 60)}`;
  return hours ? `${hours}:${rest}` : rest;
}
