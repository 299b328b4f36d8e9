// The table of robots. The server makes palette.js from `patrol/palette.py`.

import { ROBOTS } from "./palette.js";
import { $ } from "./dom.js";
import { seconds, robotStatus } from "./store.js";

export class RobotsPanel {
  static id = "robots";
  static title = "robots";
  static topics = ["frame", "select"];
  static html = `
    <table>
      <thead><tr>
        <th>robot</th>
        <th>state</th>
        <th class="n" title="wall time of the last decision">decision</th>
        <th class="n" title="time since another robot last heard it">heard</th>
        <th class="n" title="left in its battery" id="charge">charge</th>
      </tr></thead>
      <tbody id="rows"></tbody>
    </table>`;

  constructor({ store, map, select }) {
    this.store = store;
    this.map = map;
    this.select = select;
    this.rows = [];
  }

  reset() {
    const body = $("rows");
    body.replaceChildren();
    this.rows = this.store.facts.robots.map((facts, place) => {
      const row = body.insertRow();
      const cells = [0, 1, 2, 3, 4].map(() => row.insertCell());
      const dot = document.createElement("span");
      dot.className = "dot";
      dot.style.background = ROBOTS[place % ROBOTS.length];
      const name = document.createElement("button");
      name.type = "button";
      name.textContent = facts.name;
      cells[0].append(dot, name);
      cells[2].className = cells[3].className = cells[4].className = "n";
      row.addEventListener("click", () => this.select(place));
      return { row, cells, shown: "" };
    });
    this.update();
  }

  update() {
    const robots = this.store.state?.robots ?? [], listed = new Set(this.store.listed);
    this.rows.forEach(({ row }, place) => { row.hidden = !listed.has(place); });
    $("charge").hidden = !robots.some((robot) => robot[7] !== null);
    robots.forEach((robot, place) => {
      const { row, cells } = this.rows[place], selected = this.map.selected === place;
      const { word, kind } = robotStatus(robot);
      const decision = robot[4] === null ? "-" : `${robot[4].toFixed(robot[4] < 10 ? 1 : 0)} ms`;
      const heard = seconds(robot[5]);
      const charge = robot[7] === null ? "-" : `${Math.round(100 * robot[7])} %`;
      const shown = `${word} ${kind} ${decision} ${heard} ${charge} ${selected}`;
      if (shown === this.rows[place].shown) return;
      this.rows[place].shown = shown;
      cells[1].textContent = word;
      cells[1].className = `s-${kind}`;
      cells[2].textContent = decision;
      cells[3].textContent = heard;
      cells[4].textContent = charge;
      cells[4].hidden = $("charge").hidden;
      row.classList.toggle("chosen", selected);
      cells[0].lastChild.setAttribute("aria-pressed", String(selected));
    });
  }
}
