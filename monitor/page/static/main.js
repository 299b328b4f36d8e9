// The page: one WebSocket in, one frame drawn for each that came, controls out.

import { AGES, DIFFERENCES, STEPS } from "./colours.js";
import { Chart } from "./chart.js";
import { Controls } from "./controls.js";
import { isVague, roundUp } from "./fogimage.js";
import { MapView } from "./map.js";
import { $, Events, Links, Robots, tabs, write } from "./panes.js";
import { Store, clock, seconds } from "./store.js";

const DIFFERENCE = "d";
/** The code with which a server closes that has no room for another viewer. */
const FULL = 4001;
const AGAIN_MS = [500, 1000, 2000, 4000];
const READ_MS = 250;

const store = new Store(changed);
const map = new MapView($("canvas"), store, {
  hover, redraw, pick, click: (x, y) => controls.place(x, y),
});
const robots = new Robots(store, pick);
const links = new Links(store);
const events = new Events(store);
const controls = new Controls(store, ask, map);
const chart = new Chart($("chart"), store, (k) => controls.seek(k));
tabs(() => {
  links.renew();
  events.renew();
});

let socket = null;
let failures = 0;
let waiting = new Map();
let asked = 0;
let drawing = false;
let owed = false;
let besideTimer = 0, besideDue = 0;
let drawn = 0;

connect();
addEventListener("resize", redraw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  if (!store.facts) return;
  map.restyle();
  legend(true);
  chart.renew();
  links.renew();
  redraw();
});
$("layer").addEventListener("change", choose);
$("closer").addEventListener("click", () => map.zoomAt(1.4));
$("farther").addEventListener("click", () => map.zoomAt(1 / 1.4));
$("fit").addEventListener("click", fit);
$("help").addEventListener("click", () => $("keys").showModal());
addEventListener("keydown", key);

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => {
    failures = 0;
    if (typeof data === "string") store.take(JSON.parse(data));
    else store.unpack(data);
  };
  socket.onclose = ({ code }) => {
    lost(code);
    for (const [, done] of waiting) done({ done: false, text: "no connection" });
    waiting = new Map();
    if (!over()) setTimeout(connect, AGAIN_MS[Math.min(failures++, AGAIN_MS.length - 1)]);
  };
}

/** Whether a run that went on here has ended, after which there is nothing to connect to again. */
function over() {
  return Boolean(store.facts?.live && store.state?.ended);
}

/** The connection has gone: say why. */
function lost(code) {
  if (code === FULL) {
    badge("full", "bad");
    say("This page has as many viewers as it takes; close one, and this one opens by itself.");
  } else if (over()) {
    say("The run is over, and so is its page. To see it again: fogwatch replay, and the run's folder.");
  } else {
    badge("no connection", "bad");
    say(store.facts?.live ? "The page is not told any more: the run may be over." : "The page's server is gone.");
  }
}

function send(says) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(says));
}

/** Ask for something; what became of it. */
function ask(control) {
  return new Promise((done) => {
    if (socket.readyState !== WebSocket.OPEN) return done({ done: false, text: "no connection" });
    waiting.set(++asked, done);
    send({ type: "ask", id: asked, control });
  });
}

function changed(what, says) {
  switch (what) {
    case "static":
      begin();
      break;
    case "state":
      owed = true;
      controls.renew();
      header();
      if (!store.links) links.renew();
      legend();
      map.dirtyFog = true;
      redraw();
      break;
    case "terrain":
      redraw();
      break;
    case "series":
      legend();
      chart.renew();
      break;
    case "bands":
      chart.renew();
      break;
    case "links":
      links.renew();
      break;
    case "events":
      events.renew();
      break;
    case "answer":
      waiting.get(says.id)?.(says);
      waiting.delete(says.id);
      break;
  }
}

function begin() {
  const { facts } = store;
  document.title = `${facts.name} · fogwatch`;
  $("name").textContent = facts.name;
  $("name").title = facts.name;
  say(facts.note);
  map.reset();
  robots.reset();
  events.reset();
  controls.reset();
  layers();
  legend(true);
}

/** The choice of fogs: whose, and how it differs from the truth. */
function layers() {
  const { facts } = store;
  const select = $("layer"), before = select.value;
  const named = (number) => facts.robots.find((robot) => robot.number === number)?.name;
  const options = facts.layers.map(([number, name]) => {
    const text = { truth: "truth", heard: "as heard" }[name] ?? `as ${named(number)} believes`;
    return new Option(text, String(number));
  });
  const others = facts.truth ? facts.layers.filter(([, name]) => name !== "truth") : [];
  for (const [number, name] of others) {
    options.push(new Option(`${name === "heard" ? "as heard" : named(number)} against the truth`, `${DIFFERENCE}${number}`));
  }
  if (facts.direct && facts.truth) {
    options.push(new Option("beliefs: not known (direct radio)", ""));
    options.at(-1).disabled = true;
  }
  select.replaceChildren(...options);
  if (before && [...select.options].some((option) => option.value === before)) select.value = before;
  if (select.value) choose();
}

function choose() {
  const value = $("layer").value;
  const numbers = value.startsWith(DIFFERENCE) ? [Number(value.slice(1)), 0] : [Number(value)];
  map.shown = { kind: value.startsWith(DIFFERENCE) ? "difference" : "ages", layers: numbers, oldest: map.shown.oldest };
  map.dirtyFog = true;
  send({ type: "show", layers: numbers });
  legend(true);
  redraw();
}

function header() {
  const { facts, state } = store;
  $("clock").textContent = clock(state.time);
  $("clock").title = `tick ${state.k}`;
  $("mfow").textContent = seconds(state.mfow);
  $("mean").textContent = seconds(state.mean);
  const factor = state.rate * facts.step;
  $("factor").textContent = state.running && factor > 0 ? `× ${factor < 10 ? factor.toFixed(1) : Math.round(factor)}` : "-";
  if (state.ended) badge(`over: ${state.ended}`);
  else if (facts.live) badge(state.running ? "live" : "paused", state.running ? "live" : "");
  else badge("replay", "");
  say([facts.note, state.note].filter(Boolean).join(" · "));
}

function badge(text, kind = "") {
  $("mode").textContent = text;
  $("mode").className = `badge ${kind}`;
}

function say(text) {
  write($("note"), text);
  $("note").hidden = !text;
}

let shownScale = "";
/** The scale ends, in round steps, at the run's largest MFoW; while it goes on, at the largest so far. */
function legend(force = false) {
  const { facts, state } = store;
  if (!facts) return;
  caption();
  const { kind } = map.shown;
  const stalest = Math.max(store.stalest || (state?.time ?? 0), 10);
  const most = roundUp(kind === "difference" ? Math.max(Math.min(stalest / 4, 60), 10) : stalest);
  map.shown.oldest = Math.max(1, Math.round(most / facts.step));
  if (!force && shownScale === `${kind} ${most}`) return;
  shownScale = `${kind} ${most}`;
  const context = $("scale").getContext("2d");
  const image = context.createImageData(STEPS, 1);
  new Uint32Array(image.data.buffer).set(kind === "difference" ? DIFFERENCES : AGES);
  context.putImageData(image, 0, 0);
  const marks = kind === "difference" ? [-most, 0, most] : [0, most / 2, most];
  $("ticks").replaceChildren(...marks.map((value, i) => {
    const mark = document.createElement("span");
    const text = String(Math.round(value * 10) / 10).replace("-", "−");
    mark.textContent = i === marks.length - 1 ? `≥ ${text} s` : kind === "difference" && value > 0 ? `+${text}` : text;
    mark.style.left = `${(100 * i) / (marks.length - 1)}%`;
    return mark;
  }));
  map.dirtyFog = true;
}

/** What the colours stand for, or that the fog is still worked out. */
function caption() {
  const fogs = map.fogs, { kind, oldest } = map.shown, { lag } = map;
  const striped = fogs.some((fog) => {
    const k = kind === "ages" ? fog?.tick : 0;
    return fog?.since > 0 && isVague(k - fog.since + 1, k, oldest);
  });
  const what = kind === "difference" ? "s believed younger or older" : "seconds since last seen";
  const when = lag > 0 ? `, as of ${seconds(lag * store.facts.step)} ago` : "";
  const known = striped || (lag > 0 && kind === "difference") ? "; striped: not known" : "";
  write($("legendtext"), store.state && fogs.includes(null) ? "working it out" : `${what}${when}${known}`);
}

function pick(place) {
  map.selected = place === map.selected ? -1 : place;
  controls.picked(map.selected);
  robots.renew(map.selected);
  redraw();
}

function hover(text, x, y) {
  const tip = $("tip");
  tip.hidden = text === null;
  if (text === null) return;
  tip.textContent = text;
  const box = $("map");
  tip.style.left = `${Math.max(Math.min(x + 14, box.clientWidth - tip.offsetWidth - 6), 4)}px`;
  tip.style.top = `${Math.max(Math.min(y + 14, box.clientHeight - tip.offsetHeight - 6), 4)}px`;
}

/** Draw with the screen's next frame, and tell the server that there may be another. */
function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    map.draw();
    if (!owed) return;
    owed = false;
    beside();
    document.body.dataset.frames = ++drawn;
    send({ type: "drawn" });
  });
}

/** What stands beside the map is renewed as often as it can be read: a table of many robots costs more than the map. */
function beside() {
  if (besideTimer) return;
  besideTimer = setTimeout(() => {
    besideTimer = 0;
    besideDue = performance.now() + READ_MS;
    robots.renew(map.selected);
    if (!store.facts?.live) {
      events.renew();
      chart.renew();
    }
  }, Math.max(besideDue - performance.now(), 0));
}

function fit() {
  if (!store.facts) return;
  map.fit();
  redraw();
}

function key(event) {
  const { target } = event;
  if (event.ctrlKey || event.altKey || event.metaKey || $("keys").open) return;
  if (target.matches?.("select, input, textarea") && !(event.key === "Escape")) return;
  const onButton = target.matches?.("button");
  const pans = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };
  if (event.key in pans && target === $("canvas")) {
    if (map.pointing) map.steer(...pans[event.key].map((by) => -by / (event.shiftKey ? 1 : 10)));
    else map.pan(...pans[event.key]);
  } else if (event.key === "Enter" && target === $("canvas") && map.aiming) map.clickHere();
  else if (event.key === "+" || event.key === "=") map.zoomAt(1.25);
  else if (event.key === "-") map.zoomAt(0.8);
  else if (event.key === "0") fit();
  else if (event.key === "?") $("keys").showModal();
  else if (event.key === "l") next($("layer"));
  else if (event.key === "c") look();
  else if (event.key === "n") cycle(1);
  else if (event.key === "p") cycle(-1);
  else if (event.key === "Escape") {
    controls.aim(false);
    map.look(false);
    if (map.selected >= 0) pick(map.selected);
  } else if (event.key === " " && onButton) return;
  else if (!controls.key(event.key)) return;
  event.preventDefault();
}

/** A cross that arrows move tells what it stands on. */
function look() {
  $("canvas").focus();
  map.look(!map.looking);
}

function next(select) {
  const open = [...select.options].filter((option) => !option.disabled);
  open[(open.indexOf(select.selectedOptions[0]) + 1) % open.length].selected = true;
  select.dispatchEvent(new Event("change"));
}

function cycle(by) {
  const count = store.facts?.robots.length ?? 0;
  if (!count) return;
  const from = map.selected < 0 ? (by > 0 ? -1 : 0) : map.selected;
  map.selected = -1;
  pick((from + by + count) % count);
}
