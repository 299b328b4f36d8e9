// The zones: which of them are in force, and a button for each to switch it.

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
    const { facts } = this.store;
    $("tab-zones").hidden = !facts.zones.length;
    const can = facts.controls.includes("zone");
    $("zonelist").classList.toggle("switches", can);
    $("zonelist").replaceChildren(...facts.zones.map((zone) => this.#item(zone, can)));
    $("zonenote").textContent = can ? "A zone that is switched stays so to the end of the run, whatever its times say." : "";
    write($("zonesanswer"), "");
  }

  update() {
    const { state } = this.store;
    if (!state || $("zones").hidden) return;
    for (const item of $("zonelist").children) {
      const on = state.zones.includes(item.dataset.name), button = item.querySelector("button");
      item.classList.toggle("off", !on);
      write(item.querySelector(".held"), on ? "in force" : "not in force");
      if (!button) continue;
      write(button, on ? "switch off" : "switch on");
      button.disabled = Boolean(state.ended);
    }
  }

  #item({ name, label, kind }, can) {
    const item = document.createElement("li"), text = document.createElement("span"), held = document.createElement("span");
    item.dataset.name = name;
    text.className = `zone ${kind}`;
    text.textContent = label;
    held.className = "held";
    item.append(text, held);
    if (can && kind !== "keepout" && kind !== "oneway") {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-label", `switch ${name}`);
      button.addEventListener("click", () => {
        if (!this.store.state) return;
        const on = !this.store.state.zones.includes(name);
        this.operate({ do: "zone", name, on }, "", "zonesanswer");
      });
      item.append(button);
    }
    return item;
  }
}
