// Pause, step, pace and the time line.

import { $ } from "./dom.js";
import { clock } from "./store.js";

const PACES = [0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
const UNLIMITED = "unlimited";
/** For how long after a seek the slider ignores the state's tick. */
const SEEKING_MS = 400;

export class Transport {
  /** operate(control): sends a control. */
  constructor(store, operate) {
    this.store = store;
    this.operate = operate;
    this.seekingUntil = 0;
    $("play").addEventListener("click", () => this.#toggle());
    $("step").addEventListener("click", () => this.operate({ do: "step" }));
    $("pace").addEventListener("change", () => this.#pace($("pace").value));
    $("seek").addEventListener("input", () => this.seek(Number($("seek").value)));
  }

  /** A new source: show the controls that it accepts. */
  reset() {
    const { facts } = this.store;
    const can = (what) => facts.controls.includes(what);
    $("transport").hidden = !can("pause");
    $("step").hidden = !can("step");
    $("pace").parentElement.hidden = !can("pace");
    const backwards = can("seek") ? PACES.toReversed().map((pace) => -pace) : [];
    const options = [...backwards, ...PACES].map((pace) => new Option(`${pace < 0 ? "−" : ""}${Math.abs(pace)} ×`, String(pace)));
    if (!can("seek")) options.push(new Option(UNLIMITED, "null"));
    $("pace").replaceChildren(...options);
    $("timeline").hidden = !can("seek");
    $("seek").max = String((facts.ticks ?? 1) - 1);
  }

  /** A new state. */
  update() {
    const { facts, state } = this.store;
    $("play").textContent = state.running ? "pause" : facts.live ? "resume" : "play";
    $("play").disabled = Boolean(state.ended);
    $("step").disabled = Boolean(state.ended);
    const pace = String(state.pace);
    if (document.activeElement !== $("pace") && $("pace").value !== pace) {
      if (![...$("pace").options].some((option) => option.value === pace)) $("pace").add(new Option(`${pace} ×`, pace));
      $("pace").value = pace;
    }
    if ($("timeline").hidden) return;
    if (performance.now() > this.seekingUntil) $("seek").value = String(state.k);
    $("of").textContent = `${clock(state.time)} of ${clock((facts.ticks - 1) * facts.step)}`;
    $("seek").setAttribute("aria-valuetext", clock(state.time));
  }

  seek(k) {
    if (!this.store.facts.controls.includes("seek")) return;
    this.seekingUntil = performance.now() + SEEKING_MS;
    $("seek").value = String(k);
    this.operate({ do: "seek", k });
  }

  /** Handle a key; returns whether it did. */
  key(key) {
    const can = (what) => this.store.facts?.controls.includes(what);
    const paces = [...$("pace").options].map((option) => option.value);
    const at = paces.indexOf($("pace").value);
    if (key === " " && can("pause")) this.#toggle();
    else if (key === "." && can("step")) this.operate({ do: "step" });
    else if ((key === "," || key === "/") && can("seek") && this.store.state) this.#pace(String((key === "," ? -1 : 1) * Math.abs(this.store.state.pace)));
    else if (key === "]" && can("pace")) this.#pace(paces[Math.min(at + 1, paces.length - 1)]);
    else if (key === "[" && can("pace")) this.#pace(paces[Math.max(at - 1, 0)]);
    else return false;
    return true;
  }

  #toggle() {
    this.operate({ do: this.store.state?.running ? "pause" : "go" });
  }

  #pace(value) {
    this.operate({ do: "pace", factor: value === "null" ? null : Number(value) });
  }
}
