// What a viewer may ask for: pause, step and pace; a replay's place; and faults of a fleet that is running.

import { $ } from "./panes.js";
import { clock } from "./store.js";

const PACES = [0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const FASTEST = "as fast as it goes";
const SETTLED_MS = 250;
const NEWS_MS = 3000;
const ALIVE = 1, PAUSED = 2;
const AWAY = [0, 5];

export class Controls {
  /** ask(control): a promise of the answer. */
  constructor(store, ask, map) {
    this.store = store;
    this.ask = ask;
    this.map = map;
    this.seeking = 0;
    this.expected = new Map();
    this.called = new Map();
    this.lossTimer = 0;
    this.lossWanted = null;
    this.settingLoss = false;
    $("play").addEventListener("click", () => this.#turn());
    $("step").addEventListener("click", () => this.#do({ do: "step" }));
    $("pace").addEventListener("change", () => this.#pace($("pace").value));
    $("seek").addEventListener("input", () => this.seek(Number($("seek").value)));
    $("controls").addEventListener("submit", (event) => event.preventDefault());
    for (const [id, kind] of [["kill", "kill"], ["restart", "restart"], ["pauseone", "pause"], ["resumeone", "resume"]]) {
      $(id).addEventListener("click", () => this.#fault({ kind, who: this.#who() }));
    }
    $("silence").addEventListener("click", () => this.#silence());
    $("loss").addEventListener("input", () => this.#lossMoved());
    $("join").addEventListener("click", () => this.#join());
    $("intruder").addEventListener("click", () => this.aim(!this.map.aiming));
    $("who").addEventListener("change", () => this.renew());
  }

  /** A new source: show what can be asked of it. */
  reset() {
    const { facts } = this.store;
    const can = (what) => facts.controls.includes(what);
    $("transport").hidden = !can("pause");
    $("step").hidden = !can("step");
    $("pace").parentElement.hidden = !can("pace");
    const backwards = can("seek") ? PACES.toReversed().map((pace) => -pace) : [];
    const options = [...backwards, ...PACES].map((pace) => new Option(`${pace < 0 ? "−" : ""}${Math.abs(pace)} ×`, String(pace)));
    if (!can("seek")) options.push(new Option(FASTEST, "null"));
    $("pace").replaceChildren(...options);
    $("timeline").hidden = !can("seek");
    $("seek").max = String((facts.ticks ?? 1) - 1);
    $("tab-faults").hidden = !facts.live;
    $("controls").hidden = !can("fault");
    $("lookonly").hidden = can("fault");
    $("lookonly").textContent = facts.mayAsk
      ? "This fleet takes no faults: there is no world to play them."
      : "This page may only look. Open the address as it was printed, key included, to ask for something.";
    $("who").replaceChildren(...facts.robots.map((robot, place) => new Option(robot.name, String(place))));
    $("intruder").hidden = !can("intruder");
    this.expected.clear();
    this.called.clear();
  }

  /** A new state. */
  renew() {
    const { facts, state } = this.store;
    if (!state) return;
    $("play").textContent = state.running ? "pause" : "go";
    $("play").disabled = Boolean(state.ended);
    $("step").disabled = Boolean(state.ended);
    const pace = String(state.pace);
    if (document.activeElement !== $("pace") && $("pace").value !== pace) {
      if (![...$("pace").options].some((option) => option.value === pace)) $("pace").add(new Option(`${pace} ×`, pace));
      $("pace").value = pace;
    }
    if (!$("timeline").hidden) {
      if (performance.now() > this.seeking) $("seek").value = String(state.k);
      $("of").textContent = `${clock(state.time)} of ${clock((facts.ticks - 1) * facts.step)}`;
      $("seek").setAttribute("aria-valuetext", clock(state.time));
    }
    if (!facts.live) return;
    const status = state.robots[Number($("who").value)]?.[0];
    $("kill").disabled = ![ALIVE, PAUSED].includes(status);
    $("pauseone").disabled = status !== ALIVE;
    $("resumeone").disabled = status !== PAUSED;
    $("restart").disabled = AWAY.includes(status);
    if (this.lossWanted !== null) this.#settleLoss();
    const inForce = this.#inForce();
    $("silence").setAttribute("aria-pressed", String(inForce.some((fault) => silences(fault, this.#who()))));
    if (!this.lossTimer && !this.settingLoss) this.#showLoss(Math.max(0, ...inForce.filter(losesEverywhere).map((fault) => fault.rate)));
    $("silence").disabled = AWAY.includes(status);
  }

  /** A robot was chosen on the map or in the list. */
  picked(place) {
    if (place >= 0) $("who").value = String(place);
    this.renew();
  }

  seek(k) {
    if (!this.store.facts.controls.includes("seek")) return;
    this.seeking = performance.now() + 400;
    this.#do({ do: "seek", k });
  }

  /** Aim at where an intruder is to stand, or do so no more. */
  aim(on) {
    this.map.aim(on);
    $("intruder").setAttribute("aria-pressed", String(on));
    $("canvas").classList.toggle("aim", on);
    if (!on) return;
    $("canvas").focus();
    this.#say("click on the map where the intruder is to stand; or move the cross with the arrows, and Enter");
  }

  place(x, y) {
    this.aim(false);
    this.#do({ do: "intruder", place: [Math.round(x * 100) / 100, Math.round(y * 100) / 100], stay: null }, "an intruder stands there");
  }

  /** Whether a key was for us. */
  key(key) {
    const can = (what) => this.store.facts?.controls.includes(what);
    const paces = [...$("pace").options].map((option) => option.value);
    const at = paces.indexOf($("pace").value);
    if (key === " " && can("pause")) this.#turn();
    else if (key === "i" && can("intruder")) this.aim(true);
    else if (key === "." && can("step")) this.#do({ do: "step" });
    else if ((key === "," || key === "/") && can("seek") && this.store.state) this.#pace(String((key === "," ? -1 : 1) * Math.abs(this.store.state.pace)));
    else if (key === "]" && can("pace")) this.#pace(paces[Math.min(at + 1, paces.length - 1)]);
    else if (key === "[" && can("pace")) this.#pace(paces[Math.max(at - 1, 0)]);
    else return false;
    return true;
  }

  #who() {
    return this.store.facts.robots[Number($("who").value)]?.name;
  }

  #turn() {
    this.#do({ do: this.store.state?.running ? "pause" : "go" });
  }

  #pace(value) {
    this.#do({ do: "pace", factor: value === "null" ? null : Number(value) });
  }

  #fault(fault, instead) {
    return this.#do({ do: "fault", fault, instead }, `${fault.kind} ${typeof fault.who === "string" ? fault.who : ""}: asked for`);
  }

  /** The operators' faults that are in force: as the state tells, but for what it cannot tell yet. */
  #inForce() {
    const told = this.store.state.faults, now = performance.now();
    for (const [id, { fault, until }] of this.expected) {
      if (now > until || told.some((one) => one.id === id) === (fault !== null)) this.expected.delete(id);
    }
    const coming = [...this.expected.values()].map(({ fault }) => fault).filter(Boolean);
    return [...told.filter((one) => !this.expected.has(one.id)), ...coming];
  }

  /** A fault was asked for, or one ended (null): the next states will say so. */
  #expect(id, fault) {
    this.expected.set(id, { fault, until: performance.now() + NEWS_MS });
    this.renew();
  }

  async #silence() {
    if (!this.store.state) return;
    const who = this.#who(), before = this.#inForce().filter((fault) => silences(fault, who));
    if (before.length) for (const { id } of before) await this.#heal(id);
    else await this.#lasting({ kind: "silence", id: `silence-${who}-${Date.now().toString(36)}`, who, direction: "both" });
  }

  #lossMoved() {
    $("lossvalue").textContent = `${$("loss").value} %`;
    clearTimeout(this.lossTimer);
    this.lossTimer = setTimeout(() => {
      this.lossTimer = 0;
      this.lossWanted = Number($("loss").value) / 100;
      this.#settleLoss();
    }, SETTLED_MS);
  }

  /** Ask for the newest loss that is wanted once what was asked for before is answered, and what is in force is known. */
  async #settleLoss() {
    if (this.settingLoss) return;
    this.settingLoss = true;
    try {
      while (this.lossWanted !== null && this.store.state) {
        const rate = this.lossWanted;
        this.lossWanted = null;
        await this.#setLoss(rate);
      }
    } finally {
      this.settingLoss = false;
    }
    this.renew();
  }

  /** One loss in force, or none; a tick without any would be a gap. */
  async #setLoss(rate) {
    let before = this.#inForce().filter(losesEverywhere).map(({ id }) => id);
    if (rate > 0) {
      await this.#lasting({ kind: "loss", id: `loss-${Date.now().toString(36)}`, rate }, before[0]);
      before = before.slice(1);
    }
    for (const id of before) await this.#heal(id);
  }

  #showLoss(rate) {
    const share = Math.round(100 * rate);
    $("loss").value = String(share);
    $("lossvalue").textContent = `${share} %`;
  }

  /** A fault until it is taken back. instead: the one that ends at that moment, if any. */
  async #lasting(fault, instead) {
    if (!(await this.#fault(fault, instead))) return;
    if (instead) this.expected.set(instead, { fault: null, until: performance.now() + NEWS_MS });
    this.#expect(fault.id, fault);
  }

  async #heal(id) {
    if (await this.#do({ do: "heal", id }, "healed")) this.#expect(id, null);
  }

  #join() {
    const { facts, state } = this.store, now = performance.now();
    if (!state) return;
    const away = facts.robots.map((robot) => robot.name).filter((_, place) => AWAY.includes(state.robots[place][0]));
    const who = away.find((name) => !(this.called.get(name) > now));
    if (who) {
      this.called.set(who, now + NEWS_MS);
      this.#fault({ kind: "join", who });
    } else {
      this.#say(away.length ? `${away.join(", ")}: on the way` : "all robots are there; fogwatch run --spare N has more to add");
    }
  }

  async #do(control, text = "") {
    const answer = await this.ask(control);
    this.#say(answer.done ? answer.text || text : answer.text || "refused");
    return answer.done;
  }

  #say(text) {
    $("answer").textContent = text;
  }
}

/** Whether a fault keeps one robot, and it alone, from hearing and being heard. */
function silences({ kind, who, direction }, robot) {
  return kind === "silence" && direction === "both" && String(who) === robot;
}

/** Whether a fault loses frames on all links alike, as the slider does. */
function losesEverywhere(fault) {
  return fault.kind === "loss" && (fault.from ?? "all") === "all" && (fault.to ?? "all") === "all" && !fault.mean_burst;
}
