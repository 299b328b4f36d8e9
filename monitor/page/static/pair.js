// Two replays side by side, each a page of its own in a frame, with one clock; framed.js is its other side.

import { $ } from "./dom.js";
import { Playback } from "./playback.js";
import { timeOf } from "./store.js";
import { Transport } from "./transport.js";

const FRAME_MS = 1000 / 30;
const ORIGIN = location.protocol === "file:" ? "*" : location.origin;

const frames = ["first", "second"].map((id) => ({ box: $(id), replay: null, shown: null }));
/** What the transport reads, as of a replay that lasts as long as the longer one. */
const store = { facts: null, state: null };
const transport = new Transport(store, (control) => playback?.obey(control));
let playback = null;

addEventListener("message", ({ source, data }) => {
  const frame = frames.find(({ box }) => box.contentWindow === source);
  if (frame && data.type === "replay") learn(frame, data);
  else if (frame && data.type === "key") transport.key(data.key);
  else if (frame && data.type === "seek" && playback) transport.seek(Math.round(data.time / playback.step));
});
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("select, input")) return;
  if (event.key === " " && event.target.matches("button")) return;
  if (transport.key(event.key)) event.preventDefault();
});
// Frames may have been there first.
for (const { box } of frames) box.src = box.dataset.src;

function learn(frame, replay) {
  frame.replay = replay;
  frame.shown = null;
  const replays = frames.map((one) => one.replay);
  if (replays.includes(null)) return;
  const most = (value) => Math.max(...replays.map(value));
  const end = most(({ ticks, step }) => ticks * step);
  for (const { box } of frames) tell(box, { type: "scale", stalest: most(({ stalest }) => stalest), end });
  document.title = `${replays.map(({ name }) => name).join(", ")} · replay · fogwatch`;
  // Without the right to control, frames show what the server's replays show.
  if (playback || !replays.every(({ controls }) => controls.includes("seek"))) return;
  const step = Math.min(...replays.map((one) => one.step));
  const last = Math.round(most((one) => (one.ticks - 1) * one.step) / step);
  playback = new Playback({ last, step, pace: most(({ pace }) => pace) });
  store.facts = { controls: ["pause", "step", "pace", "seek"], ticks: last + 1, step, live: false };
  transport.reset();
  const opensAt = timeOf(new URLSearchParams(location.search).get("t"));
  if (opensAt !== null) {
    playback.obey({ do: "pause" });
    playback.obey({ do: "seek", k: Math.round(opensAt / step) });
  }
  setInterval(show, FRAME_MS);
}

/** Have both frames show the present time. */
function show() {
  playback.advance();
  const { tick: k, step, running, pace } = playback;
  for (const frame of frames) {
    if (frame.shown === k) continue;
    frame.shown = k;
    tell(frame.box, { type: "time", time: k * step });
  }
  store.state = { k, time: k * step, running, pace, ended: null };
  transport.update();
}

function tell(box, message) {
  box.contentWindow.postMessage(message, ORIGIN);
}
