// The list of events, the newest first.

import { $ } from "./dom.js";
import { seconds } from "./store.js";

/** Events in the list at most. */
const MOST = 300;

export class EventsPanel {
  static id = "events";
  static title = "events";
  static topics = ["events", "frame", "open"];
  static html = `<ol id="list"></ol>`;

  constructor({ store }) {
    this.store = store;
    this.count = -1;
  }

  reset() {
    this.count = -1;
  }

  update() {
    const { store } = this;
    if (!store.facts) return;
    const list = $("list");
    if (this.count !== store.events.length) {
      this.count = store.events.length;
      // What a replay finds later may have happened earlier.
      const events = store.events.toSorted((one, other) => one[0] - other[0]);
      list.replaceChildren(...events.slice(-MOST).reverse().map((event) => this.#item(event)));
      if (!this.count) list.append(Object.assign(document.createElement("li"), { textContent: "no events yet" }));
    }
    if (store.facts.live) return;
    const now = store.state?.k ?? 0;
    for (const item of list.children) item.classList.toggle("later", Number(item.dataset.k) > now);
  }

  #item([k, kind, robot, detail]) {
    const item = document.createElement("li");
    item.dataset.k = k;
    const when = document.createElement("span");
    when.className = "when";
    when.textContent = seconds(k * this.store.facts.step);
    const what = document.createElement("span");
    const word = document.createElement("b");
    const name = this.store.facts.robots.find((one) => one.number === robot)?.name;
    word.textContent = [name, kind].filter(Boolean).join(" ");
    what.append(word, detail ? ` ${detail}` : "");
    item.append(when, what);
    return item;
  }
}
