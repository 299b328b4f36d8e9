// The zones: which of them are in force, a button for each to switch it, and a field for another weight.

import { $, write } from "./dom.js";

export class ZonesPanel {
  static id = "zones";
  static title = "zones";
  static topics = ["state", "open"];
  static html = `
    <ul id="zonelist"></ul>
    <p id="zonenote" class="small"></p>
    <p id="zonesanswer" class="small" role="status"></p>`;

  constructor({ store, operate }) {
    this.store = store;
    this.operate = operate;
  }

  reset() {
    const { facts } = this.store, zones = facts.marks.filter(({ section }) => section === "zones");
    $("tab-zones").hidden = !zones.length;
    const can = facts.controls.includes("zone");
    $("zonelist").classList.toggle("switches", can);
    $("zonelist").replaceChildren(...zones.map((zone) => this.#item(zone, can)));
    $("zonenote").textContent = can ? "A zone that is switched stays so to the end of the run, whatever its times say. A weight is from 0.001 to 1000; Enter gives it to the zone." : "";
    write($("zonesanswer"), "");
  }

  update() {
    const { state } = this.store;
    if (!state || $("zones").hidden) return;
    for (const item of $("zonelist").children) {
      const [label, on, , , weight] = state.looks.zones[item.dataset.name];
      const button = item.querySelector("button"), field = item.querySelector("input");
      item.classList.toggle("off", !on);
      write(item.querySelector(".zone"), label);
      write(item.querySelector(".held"), on ? "in force" : "not in force");
      if (!button) continue;
      write(button, on ? "switch off" : "switch on");
      button.disabled = Boolean(state.ended);
      if (!field) continue;
      field.hidden = weight === null;
      field.disabled = Boolean(state.ended);
      if (document.activeElement !== field) field.value = weight;
    }
  }

  #item({ name, label, kind }, can) {
    const item = document.createElement("li"), text = document.createElement("span"), held = document.createElement("span");
    item.dataset.name = name;
    text.className = `zone ${kind}`;
    text.textContent = label;
    held.className = "held";
    item.append(text, held);
    if (can && kind !== "keepout") {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-label", `switch ${name}`);
      button.addEventListener("click", () => {
        if (!this.store.state) return;
        const [, on] = this.store.state.looks.zones[name];
        this.operate({ do: "zone", name, on: !on }, "", "zonesanswer");
      });
      item.append(button);
      if (kind === "weight") item.append(this.#weight(name));
    }
    return item;
  }

  /** The field for another weight; Enter gives that to the zone, and whoever leaves the field drops it. */
  #weight(name) {
    const field = document.createElement("input");
    Object.assign(field, { type: "number", min: 0.001, max: 1000, step: "any" });
    field.setAttribute("aria-label", `weight of ${name}`);
    field.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || !this.store.state || !field.value) return;
      const [, , , , holds] = this.store.state.looks.zones[name], weight = Number(field.value);
      if (weight !== holds) this.operate({ do: "zone", name, weight }, "", "zonesanswer");
    });
    field.addEventListener("blur", () => this.update());
    return field;
  }
}
