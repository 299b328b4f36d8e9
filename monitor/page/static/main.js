// The page: receives messages over a WebSocket or, of a saved run, from a script, draws a frame for each state, and sends controls.

import { AGES, DIFFERENCES, STEPS } from "./colours.js";
import { Chart } from "./chart.js";
import { $, write } from "./dom.js";
import { Framed } from "./framed.js";
import { isVague, roundUp } from "./fogimage.js";
import { MapView } from "./map.js";
import { Panels } from "./panels.js";
import { RecordedSocket } from "./recorded.js";
import { Store, clock, seconds, timeOf } from "./store.js";
import { Transport } from "./transport.js";

const DIFFERENCE = "d";
/** Close code of a server that has reached its limit of viewers; server.py has the same number. */
const FULL = 4001;
const RECONNECT_MS = [500, 1000, 2000, 4000];
/** Least time between two updates of the panels by frames. */
const PANELS_MS = 250;

const store = new Store(changed);
const map = new MapView($("canvas"), store, { hover, redraw, select });
const asked = new URLSearchParams(location.search);
const transport = asked.has("pair") ? new Framed(store, operate, rescale) : new Transport(store, operate);
const chart = new Chart($("chart"), store, (k) => transport.seek(k));
const panels = new Panels({ store, map, select, operate });

let socket = null;
let failures = 0;
let waiting = new Map();
let requests = 0;
let drawing = false;
let unreported = false;
let panelsTimer = 0, panelsDue = 0;
let drawn = 0;
/** The time at which a replay opens, from the page's address (?t=90 or ?t=1:30), s; null without one. */
let opensAt = timeOf(asked.get("t"));
let listed = "";

connect();
addEventListener("resize", redraw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  if (!store.facts) return;
  map.restyle();
  legend(true);
  chart.renew();
  panels.update("theme");
  redraw();
});
$("layer").addEventListener("change", choose);
$("zoomin").addEventListener("click", () => map.zoomAt(1.4));
$("zoomout").addEventListener("click", () => map.zoomAt(1 / 1.4));
$("fit").addEventListener("click", fit);
$("help").addEventListener("click", () => $("keys").showModal());
addEventListener("keydown", onKey);

function connect() {
  const server = new URL("live", location.href);
  server.protocol = server.protocol === "https:" ? "wss:" : "ws:";
  socket = globalThis.RECORDED ? new RecordedSocket(globalThis.RECORDED) : new WebSocket(server);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => {
    failures = 0;
    if (typeof data === "string") store.receive(JSON.parse(data));
    else store.unpack(data);
  };
  socket.onclose = ({ code }) => {
    lost(code);
    for (const [, done] of waiting) done({ done: false, text: "no connection" });
    waiting = new Map();
    if (!over()) setTimeout(connect, RECONNECT_MS[Math.min(failures++, RECONNECT_MS.length - 1)]);
  };
}

/** Whether the run of a live page has ended; then there is no reason to connect again. */
function over() {
  return Boolean(store.facts?.live && store.state?.ended);
}

/** The connection was lost: show why. */
function lost(code) {
  if (code === FULL) {
    badge("full", "bad");
    note("The limit of viewers is reached. Close another viewer; this page then connects by itself.");
  } else if (over()) {
    note("The run is over and its page has closed. To view it again: fogwatch replay, with the run's folder.");
  } else {
    badge("no connection", "bad");
    note(store.facts?.live ? "No connection to the page's server; the run may be over." : "No connection to the page's server.");
  }
}

function send(message) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

/** Send a control and show the answer. text: shown if it is accepted without one. Returns whether it is accepted. */
async function operate(control, text = "", shownIn = "answer") {
  const answer = await new Promise((done) => {
    if (socket.readyState !== WebSocket.OPEN) return done({ done: false, text: "no connection" });
    waiting.set(++requests, done);
    send({ type: "control", id: requests, control });
  });
  write($(shownIn), answer.text || (answer.done ? text : "refused"));
  return answer.done;
}

function changed(topic, message) {
  switch (topic) {
    case "static":
      begin();
      break;
    case "state":
      unreported = true;
      transport.update();
      header();
      legend();
      if (listed !== String(store.listed)) layers();
      map.dirtyFog = true;
      redraw();
      break;
    case "terrain":
      redraw();
      break;
    case "series":
      if (store.state) transport.update();
      legend();
      chart.renew();
      break;
    case "bands":
      chart.renew();
      break;
    case "answer":
      waiting.get(message.id)?.(message);
      waiting.delete(message.id);
      break;
  }
  panels.update(topic);
}

function begin() {
  const { facts } = store;
  document.title = `${facts.title} · ${facts.live ? "" : "replay · "}fogwatch`;
  $("name").textContent = asked.has("pair") ? facts.name : facts.title;
  $("name").title = facts.name;
  $("patrolbox").hidden = !facts.patrol;
  $("patrolbox").title = facts.patrol;
  $("patrol").textContent = facts.patrol.split(": ")[0];
  note(facts.note);
  map.reset();
  transport.reset();
  panels.reset();
  layers();
  legend(true);
  if (opensAt !== null && facts.controls.includes("seek")) {
    operate({ do: "pause" });
    transport.seek(Math.round(opensAt / facts.step));
  }
  opensAt = null;
}

/** The choice of fogs, and of their errors. */
function layers() {
  const { facts } = store;
  const menu = $("layer"), before = menu.value;
  listed = String(store.listed);
  const shown = new Set(store.listed.map((place) => facts.robots[place].number));
  const layers = facts.layers.filter(([, name]) => ["truth", "heard"].includes(name) || shown.has(Number(name)));
  const named = (number) => facts.robots.find((robot) => robot.number === number)?.name;
  const options = layers.map(([number, name]) => {
    const text = { truth: "true fog", heard: "from heard positions" }[name] ?? `belief of ${named(number)}`;
    return new Option(text, String(number));
  });
  const others = facts.truth ? layers.filter(([, name]) => name !== "truth") : [];
  for (const [number, name] of others) {
    options.push(new Option(name === "heard" ? "error from heard positions" : `belief error of ${named(number)}`, `${DIFFERENCE}${number}`));
  }
  if (facts.direct && facts.truth) {
    options.push(new Option("beliefs: unknown (direct radio)", ""));
    options.at(-1).disabled = true;
  }
  menu.replaceChildren(...options);
  if (before && [...menu.options].some((option) => option.value === before)) menu.value = before;
  if (menu.value && (menu.value !== before || !store.state)) choose();
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
  $("seenbox").hidden = state.seen === null || state.seen === 1;
  $("seen").textContent = `${(Math.floor(state.seen * 1000) / 10).toFixed(1)} %`;
  $("stalestbox").hidden = !state.stalest?.[2];
  if (state.stalest) $("stalest").textContent = `${state.stalest[0].toFixed(1)}, ${state.stalest[1].toFixed(1)} m`;
  const factor = state.rate * facts.step;
  $("factor").textContent = state.running && factor > 0 ? `× ${factor < 10 ? factor.toFixed(1) : Math.round(factor)}` : "-";
  if (state.ended) badge(`over: ${state.ended}`);
  else if (facts.live) badge(state.running ? "live" : "paused", state.running ? "live" : "");
  else badge("replay", "");
  note([facts.note, state.note].filter(Boolean).join(" · "));
}

function badge(text, kind = "") {
  $("mode").textContent = text;
  $("mode").className = `badge ${kind}`;
}

function note(text) {
  write($("note"), text);
  $("note").hidden = !text;
}

/** The largest MFoW or the end of the time that scales have room for has changed. */
function rescale() {
  legend();
  chart.renew();
  redraw();
}

let shownScale = "";
/** The scale ends at the largest MFoW of the run, or of the run so far, rounded up. */
function legend(force = false) {
  const { facts, state } = store;
  if (!facts) return;
  caption();
  const { kind } = map.shown;
  const stalest = Math.max(store.oldest || (state?.time ?? 0), 10);
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

/** What the colours mean, or that the fog is being computed. */
function caption() {
  const fogs = map.fogs, { kind, oldest } = map.shown, { lag } = map;
  const striped = fogs.some((fog) => {
    const k = kind === "ages" ? fog?.tick : 0;
    return fog?.since > 0 && isVague(k - fog.since + 1, k, oldest);
  });
  const what = kind === "difference" ? "believed minus true age (s)" : "seconds since last seen";
  const when = lag > 0 ? `, as of ${seconds(lag * store.facts.step)} ago` : "";
  const known = striped || (lag > 0 && kind === "difference") ? "; striped: unknown" : "";
  write($("legendtext"), store.state && fogs.includes(null) ? "computing …" : `${what}${when}${known}`);
}

/** Select a robot by its place, or deselect it if it is selected. */
function select(place) {
  map.selected = place === map.selected ? -1 : place;
  panels.update("select");
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

/** Draw with the screen's next frame, then report the state as drawn, so that the server sends the next one. */
function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    map.draw();
    $("neverkey").hidden = !map.unseen;
    if (!unreported) return;
    unreported = false;
    updatePanels();
    document.body.dataset.frames = ++drawn;
    send({ type: "drawn" });
  });
}

/** Update the panels, and the chart of a replay, at a rate at which they can be read: they cost more than the map. */
function updatePanels() {
  if (panelsTimer) return;
  panelsTimer = setTimeout(() => {
    panelsTimer = 0;
    panelsDue = performance.now() + PANELS_MS;
    panels.update("frame");
    if (!store.facts?.live) chart.renew();
  }, Math.max(panelsDue - performance.now(), 0));
}

function fit() {
  if (!store.facts) return;
  map.fit();
  redraw();
}

function onKey(event) {
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
  else if (event.key === "c") inspect();
  else if (event.key === "n") cycle(1);
  else if (event.key === "p") cycle(-1);
  else if (event.key === "Escape") {
    panels.key(event.key);
    map.inspect(false);
    if (map.selected >= 0) select(map.selected);
  } else if (event.key === " " && onButton) return;
  else if (!transport.key(event.key) && !panels.key(event.key)) return;
  event.preventDefault();
}

/** Show or hide the cross that shows the age of a point; arrow keys move it. */
function inspect() {
  $("canvas").focus();
  map.inspect(!map.inspecting);
}

function next(menu) {
  const open = [...menu.options].filter((option) => !option.disabled);
  open[(open.indexOf(menu.selectedOptions[0]) + 1) % open.length].selected = true;
  menu.dispatchEvent(new Event("change"));
}

function cycle(by) {
  const places = store.facts ? store.listed : [], count = places.length;
  if (!count) return;
  const from = map.selected < 0 ? (by > 0 ? -1 : 0) : places.indexOf(map.selected);
  map.selected = -1;
  select(places[(from + by + count) % count]);
}
