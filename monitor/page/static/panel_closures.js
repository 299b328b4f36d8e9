// The closures with their state; an operator closes and opens them here.

import { $, write } from "./dom.js";

const KINDS = ["close", "open"];

export class ClosuresPanel {
  static id = "closures";
  static title = "closures";
  static topics = ["state", "open"];
  static html = `
    <ul id="closurelist"></ul>
    <p id="closureshelp" class="small"></p>
    <p id="closuresanswer" class="small" role="status"></p>`;

  constructor({ store, operate }) {
    this.store = store;
    this.operate = operate;
    this.items = [];
  }

  reset() {
    const { marks, truth, controls } = this.store.facts, closures = marks.filter(({ section }) => section === "closures");
    $("tab-closures").hidden = !truth || !closures.length;
    this.items = closures.map(({ name }) => this.#item(name, controls.includes("fault")));
    $("closurelist").replaceChildren(...this.items.map(({ item }) => item));
    const how = controls.includes("fault") ? " Press the button again to take it back." : "";
    write($("closureshelp"), `Held: closed or opened by an operator, whatever the closure's own times say.${how}`);
    write($("closuresanswer"), "");
  }

  update() {
    const { state } = this.store;
    if (!state || $("closures").hidden) return;
    for (const { name, word, buttons } of this.items) {
      const held = this.#held(name);
      const { text, kind } = closureState(name, state, held, this.store.facts.step);
      write(word, text);
      word.className = `s-${kind}`;
      buttons.forEach((button, i) => {
        button.setAttribute("aria-pressed", String(held?.kind === KINDS[i]));
        button.disabled = Boolean(state.ended);
      });
    }
  }

  /** The operators' fault in force that holds a closure, the one that began last; undefined where none does. */
  #held(name) {
    return this.store.state.faults
      .filter(({ kind, closure }) => KINDS.includes(kind) && closure === name)
      .reduce((last, one) => (last && last.at > one.at ? last : one), undefined);
  }

  #item(name, mayControl) {
    const item = document.createElement("li"), title = document.createElement("b"), word = document.createElement("span");
    title.textContent = name;
    item.append(title, word);
    const buttons = (mayControl ? KINDS : []).map((kind) => {
      const button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: kind });
      button.setAttribute("aria-label", `${kind} ${name}`);
      button.addEventListener("click", () => this.#press(kind, name));
      item.append(button);
      return button;
    });
    return { item, name, word, buttons };
  }

  #press(kind, closure) {
    if (!this.store.state) return;
    const held = this.#held(closure);
    const control = held?.kind === kind ? { do: "heal", id: held.id } : { do: "fault", fault: { kind, closure } };
    this.operate(control, "", "closuresanswer");
  }
}

/** The state of a closure as {text, kind}; kind as for a robot. A fault of the scenario may overrule an operator's. */
function closureState(name, { looks, k }, held, step) {
  const [, , isClosed, waits] = looks.closures[name];
  if (waits) return { text: "waits until robots have left", kind: "warn" };
  const agrees = held && isClosed === (held.kind === "close");
  if (held && !agrees && held.at > k * step) return { text: isClosed ? "opens with the next tick" : "closes with the next tick", kind: "warn" };
  return { text: `${agrees ? "held " : ""}${isClosed ? "closed" : "open"}`, kind: isClosed ? "warn" : "good" };
}
