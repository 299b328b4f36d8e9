// The panels beside the map, one tab each.
//
// To add a panel: write a module with a class like those below, and add it to PANELS. Of such a class
//
//     static id, title     id of its section, and the text of its tab
//     static html          content of its section
//     static topics        when to update: "state", "links", "events", "series" and "bands" after such a message, "frame"
//                          after a drawn frame (four times a second at most), "select" after a robot was selected,
//                          "theme" after a change of the colour scheme, "open" after its tab was opened
//     constructor(page)    after its section was added; page: {store, map, select(place), operate(control, text, shownIn)}
//     reset()              a new source
//     update(topic)        show what is new
//     key(key)             optional: handle a key; returns whether it did
//
// store.state is the newest message of `state_message` in monitor/page/messages.py, which says what each place of a
// robot's list holds.

import { ClosuresPanel } from "./panel_closures.js";
import { EventsPanel } from "./panel_events.js";
import { FaultsPanel } from "./panel_faults.js";
import { LinksPanel } from "./panel_links.js";
import { RobotsPanel } from "./panel_robots.js";
import { ZonesPanel } from "./panel_zones.js";
import { $ } from "./dom.js";

/** Where the panels are below the map; page.css has the same number. An opened panel is then scrolled to. */
const NARROW = matchMedia("(max-width: 820px)");
const PANELS = [RobotsPanel, LinksPanel, EventsPanel, FaultsPanel, ClosuresPanel, ZonesPanel];

export class Panels {
  /** page: as for the panels. */
  constructor(page) {
    this.tabs = [];
    this.panels = PANELS.map((Panel, place) => {
      this.tabs.push(this.#add(Panel, place === 0));
      return new Panel(page);
    });
  }

  reset() {
    for (const panel of this.panels) panel.reset();
  }

  update(topic) {
    for (const panel of this.panels) if (panel.constructor.topics.includes(topic)) panel.update(topic);
  }

  /** Whether a panel has handled a key. */
  key(key) {
    return this.panels.some((panel) => panel.key?.(key));
  }

  #add({ id, title, html }, open) {
    const tab = document.createElement("button");
    Object.assign(tab, { id: `tab-${id}`, type: "button", textContent: title, tabIndex: open ? 0 : -1 });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", id);
    tab.setAttribute("aria-selected", String(open));
    tab.addEventListener("click", () => this.#open(tab));
    tab.addEventListener("keydown", (event) => this.#move(event, tab));
    $("tabs").append(tab);
    const section = document.createElement("section");
    Object.assign(section, { id, className: "panel", tabIndex: 0, hidden: !open, innerHTML: html });
    section.setAttribute("role", "tabpanel");
    section.setAttribute("aria-labelledby", tab.id);
    $("panels").append(section);
    return tab;
  }

  #open(tab) {
    for (const one of this.tabs) {
      const chosen = one === tab;
      one.setAttribute("aria-selected", String(chosen));
      one.tabIndex = chosen ? 0 : -1;
      $(one.getAttribute("aria-controls")).hidden = !chosen;
    }
    this.update("open");
    if (NARROW.matches) scrollBy({ top: $("tabs").getBoundingClientRect().top - document.querySelector("header").offsetHeight });
  }

  #move(event, tab) {
    const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!move) return;
    const visible = this.tabs.filter((one) => !one.hidden);
    const next = visible[(visible.indexOf(tab) + move + visible.length) % visible.length];
    next.focus();
    this.#open(next);
    event.preventDefault();
  }
}
