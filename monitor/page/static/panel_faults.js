// Faults of a running fleet: of one robot, of the radio, and intruders.

import { $, write } from "./dom.js";

/** How long to wait after the slider of the loss was moved. */
const SETTLED_MS = 250;
/** How long a state may take to show a fault that was accepted. */
const EXPECTED_MS = 3000;
const ALIVE = 1, PAUSED = 2;
const AWAY = [0, 5];

export class FaultsPanel {
  static id = "faults";
  static title = "faults";
  static topics = ["state", "select"];
  static html = `
    <p id="viewonly" class="small" hidden></p>
    <form id="controls">
      <fieldset id="one"><legend>one robot</legend>
        <label>robot <select id="who"></select></label>
        <div class="row">
          <button type="button" id="kill">kill</button>
          <button type="button" id="restart">restart</button>
          <button type="button" id="pauseone">pause</button>
          <button type="button" id="resumeone">resume</button>
          <button type="button" id="silence" aria-pressed="false">silence</button>
        </div>
      </fieldset>
      <fieldset id="radio"><legend>all links</legend>
        <label class="slide">loss <input type="range" id="loss" min="0" max="100" step="5" value="0"> <output id="lossvalue">0 %</output></label>
      </fieldset>
      <fieldset id="more"><legend>add</legend>
        <div class="row">
          <button type="button" id="join">add a robot</button>
          <button type="button" id="intruder" aria-pressed="false">place an intruder</button>
        </div>
        <div class="row" id="there" hidden>
          <select id="which" aria-label="intruder"></select>
          <button type="button" id="remove">remove</button>
        </div>
      </fieldset>
    </form>
    <p id="answer" class="small" role="status"></p>`;

  constructor({ store, map, operate }) {
    this.store = store;
    this.map = map;
    this.operate = operate;
    this.expected = new Map();
    this.joining = new Map();
    this.intruders = "";
    this.lossTimer = 0;
    this.lossWanted = null;
    this.settingLoss = false;
    $("controls").addEventListener("submit", (event) => event.preventDefault());
    for (const [id, kind] of [["kill", "kill"], ["restart", "restart"], ["pauseone", "pause"], ["resumeone", "resume"]]) {
      $(id).addEventListener("click", () => this.#fault({ kind, who: this.#who() }));
    }
    $("silence").addEventListener("click", () => this.#silence());
    $("loss").addEventListener("input", () => this.#lossMoved());
    $("join").addEventListener("click", () => this.#join());
    $("intruder").addEventListener("click", () => this.aim(!this.map.aiming));
    $("who").addEventListener("change", () => this.update());
    $("remove").addEventListener("click", () => this.operate({ do: "heal", id: $("which").value }, "intruder removed"));
    $("stopall").addEventListener("click", () => this.#all("stop", "pause"));
    $("releaseall").addEventListener("click", () => this.#all("release", "resume"));
  }

  reset() {
    const { facts } = this.store;
    const can = (what) => facts.controls.includes(what);
    $("tab-faults").hidden = !facts.live;
    $("controls").hidden = !can("fault");
    $("orders").hidden = !can("fault") && !can("stop");
    for (const id of ["one", "radio", "more"]) $(id).hidden = !can("fault");
    $("viewonly").hidden = can("fault");
    $("viewonly").textContent = facts.mayControl
      ? "Faults are not available: no world simulates these robots."
      : "This page is view-only. To control the fleet, open the address exactly as printed, including its key.";
    this.#listRobots();
    $("intruder").hidden = !can("intruder");
    this.expected.clear();
    this.joining.clear();
  }

  update(topic) {
    if (topic === "select" && this.map.selected >= 0) $("who").value = String(this.map.selected);
    const { facts, state } = this.store;
    if (!state || !facts.live) return;
    if ($("who").options.length !== this.store.listed.length) this.#listRobots();
    this.#listIntruders();
    if (!facts.controls.includes("fault")) return;
    const away = this.#away().length, status = state.robots[Number($("who").value)]?.[0];
    write($("join"), `add a robot${away ? ` (${away} can join)` : ""}`);
    $("kill").disabled = ![ALIVE, PAUSED].includes(status);
    $("pauseone").disabled = status !== ALIVE;
    $("resumeone").disabled = status !== PAUSED;
    $("restart").disabled = AWAY.includes(status);
    if (this.lossWanted !== null) this.#settleLoss();
    const inForce = this.#inForce();
    $("silence").setAttribute("aria-pressed", String(inForce.some((fault) => silences(fault, this.#who()))));
    if (!this.lossTimer && !this.settingLoss) this.#showLoss(Math.max(0, ...inForce.filter(losesEverywhere).map((fault) => fault.rate)));
    $("silence").disabled = AWAY.includes(status);
    const statuses = state.robots.map(([one]) => one);
    $("stopall").disabled = !statuses.includes(ALIVE);
    $("releaseall").disabled = !statuses.includes(PAUSED);
  }

  /** Stop or release all robots: by an order to robots that no world simulates, else by a fault of their processes. */
  #all(order, kind) {
    const control = this.store.facts.controls.includes(order) ? { do: order } : { do: "fault", fault: { kind, who: "all" } };
    this.operate(control, `${order}: requested`, "ordered");
  }

  #listIntruders() {
    const there = this.store.state.intruders, names = there.map(([, , name]) => name).join();
    $("there").hidden = !there.length;
    if (this.intruders === names) return;
    this.intruders = names;
    const before = $("which").value;
    $("which").replaceChildren(...there.map(([x, y, name]) => new Option(`${name} at ${x.toFixed(1)}, ${y.toFixed(1)} m`, name)));
    if (there.some(([, , name]) => name === before)) $("which").value = before;
  }

  #listRobots() {
    const { facts, listed } = this.store, before = $("who").value;
    $("who").replaceChildren(...listed.map((place) => new Option(facts.robots[place].name, String(place))));
    if (before && listed.includes(Number(before))) $("who").value = before;
  }

  /** Start to aim at a place for an intruder, or stop. */
  aim(on) {
    this.map.aim(on ? (x, y) => this.#place(x, y) : null);
    $("intruder").setAttribute("aria-pressed", String(on));
    $("canvas").classList.toggle("aim", on);
    if (!on) return;
    $("canvas").focus();
    this.#say("Click on the map to place the intruder, or move the cross with the arrow keys and press Enter.");
  }

  #place(x, y) {
    this.aim(false);
    this.operate({ do: "intruder", place: [Math.round(x * 100) / 100, Math.round(y * 100) / 100] }, "intruder placed");
  }

  key(key) {
    if (key === "Escape") this.aim(false);
    if (key !== "i" || !this.store.facts?.controls.includes("intruder")) return false;
    this.aim(true);
    return true;
  }

  #who() {
    return this.store.facts.robots[Number($("who").value)]?.name;
  }

  #fault(fault, instead) {
    return this.operate({ do: "fault", fault, instead }, `${fault.kind} ${typeof fault.who === "string" ? fault.who : ""}: requested`);
  }

  /** The operators' faults in force: those of the state, corrected by requests that it cannot show yet. */
  #inForce() {
    const known = this.store.state.faults, now = performance.now();
    for (const [id, { fault, until }] of this.expected) {
      if (now > until || known.some((one) => one.id === id) === (fault !== null)) this.expected.delete(id);
    }
    const coming = [...this.expected.values()].map(({ fault }) => fault).filter(Boolean);
    return [...known.filter((one) => !this.expected.has(one.id)), ...coming];
  }

  /** A fault was requested, or one ended (null): the next states will show it. */
  #expect(id, fault) {
    this.expected.set(id, { fault, until: performance.now() + EXPECTED_MS });
    this.update();
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

  /** Request the newest loss wanted, after the answer to the one before, and once the faults in force are known. */
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
    this.update();
  }

  /** Keep at most one loss in force, without a tick between two of them. */
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

  /** Request a fault that lasts until it is ended. instead: the one that it replaces, if any. */
  async #lasting(fault, instead) {
    if (!(await this.#fault(fault, instead))) return;
    if (instead) this.expected.set(instead, { fault: null, until: performance.now() + EXPECTED_MS });
    this.#expect(fault.id, fault);
  }

  async #heal(id) {
    if (await this.operate({ do: "heal", id }, "fault ended")) this.#expect(id, null);
  }

  /** Names of the robots that can join. */
  #away() {
    const { facts, state } = this.store;
    return facts.robots.map((robot) => robot.name).filter((_, place) => AWAY.includes(state.robots[place]?.[0]));
  }

  #join() {
    if (!this.store.state) return;
    const away = this.#away(), now = performance.now();
    const who = away.find((name) => !(this.joining.get(name) > now));
    if (who) {
      this.joining.set(who, now + EXPECTED_MS);
      this.#fault({ kind: "join", who });
    } else {
      this.#say(away.length ? `${away.join(", ")}: joining` : "All robots have joined. Start the fleet with --spare N to have N more.");
    }
  }

  #say(text) {
    write($("answer"), text);
  }
}

/** Whether a fault silences one robot, and only this one, in both directions. */
function silences({ kind, who, direction }, robot) {
  return kind === "silence" && direction === "both" && String(who) === robot;
}

/** Whether a fault is a loss on all links, as the slider requests. */
function losesEverywhere(fault) {
  return fault.kind === "loss" && (fault.from ?? "all") === "all" && (fault.to ?? "all") === "all" && !fault.mean_burst;
}
