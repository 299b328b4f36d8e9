// What is drawn on the map: robots with footprint, trail and goal, intruders, the stalest point, the cross, the scale bar.

import { MARKS, ROBOTS } from "./palette.js";
import { robotStatus, stalestAge } from "./store.js";

const LEAST = 5;
/** Ranks of labels: where two lie on each other, the one of the lower rank is shown. */
const SELECTED = 0, ROBOT = 1, STALEST = 2, MARK = 3;
/** Height of a line of a label. */
const LINE = 16;
const RAYS = 120;
/** In fleets of more than MANY robots only the selected one has a footprint, a goal and a full trail; others: SHORT ticks. */
const MANY = 24, SHORT = 60;
export const PASSABLE = 1;

/** Draw all robots, one kind of mark after the other, and the intruders. */
export function drawRobots(map) {
  const { context: c, store } = map;
  const robots = store.state.robots, facts = store.facts.robots;
  c.lineJoin = c.lineCap = "round";
  robots.forEach((robot, place) => footprint(map, robot, facts[place], place));
  robots.forEach((robot, place) => trail(map, place));
  robots.forEach((robot, place) => goal(map, robot, place));
  robots.forEach((robot, place) => body(map, robot, facts[place], place));
  robots.forEach(([, , pose], place) => {
    if (!pose || (robots.length > MANY && place !== map.selected)) return;
    const rank = place === map.selected ? SELECTED : ROBOT, reach = bodySize(map, facts[place]) + 4 * map.ratio;
    labelMark(map, rank, facts[place].name, ...map.toScreen(pose[0], pose[1]), reach);
  });
  for (const [x, y] of store.state.intruders) intruder(map, x, y);
}

/** Draw the outlines and places that the scenario has: strongly what holds now, filled what is closed, and its label. */
export function drawMarks(map) {
  const c = map.context, r = map.ratio, arm = 5 * r;
  const { facts: { point, width, origin, marks }, state } = map.store;
  c.lineCap = "butt";
  for (const mark of marks) {
    const [text, strong, filled, waits] = state?.looks[mark.section]?.[mark.name] ?? [mark.label, true];
    const [x, y] = map.toScreen(...mark.at), reach = mark.radius * map.scale;
    if (filled) {
      c.beginPath();
      for (const [first, count] of mark.runs) {
        const [x, y] = map.toScreen(origin[0] + (first % width) * point, origin[1] + (Math.floor(first / width) + 1) * point);
        c.rect(x, y, count * point * map.scale, point * map.scale);
      }
      c.fillStyle = MARKS[mark.kind];
      c.fill();
    }
    c.setLineDash(waits ? [4 * r, 3 * r] : strong || mark.runs.length ? [] : [5 * r, 5 * r]);
    for (const [colour, wide] of [["rgb(255 255 255 / 85%)", strong ? 4 : 2.5], [MARKS[mark.kind], strong ? 2 : 1]]) {
      c.strokeStyle = colour;
      c.lineWidth = wide * r;
      c.beginPath();
      for (const [x0, y0, x1, y1] of mark.edges) {
        c.moveTo(...map.toScreen(x0, y0));
        c.lineTo(...map.toScreen(x1, y1));
      }
      if (reach) c.arc(x, y, reach, 0, 2 * Math.PI);
      c.stroke();
      if (reach) {
        line(c, x - arm, y, x + arm, y);
        line(c, x, y - arm, x, y + arm);
      }
    }
    c.setLineDash([]);
    if (strong) labelMark(map, MARK, text, x, y, reach ? Math.max(reach, arm) : mark.runs.length ? 6 * r : 0);
  }
}

/** Mark the stalest point of the first fog, with its age. */
export function drawStalest(map) {
  const { stalest } = map.store.state;
  if (!stalest?.[2]) return;
  const c = map.context, r = map.ratio, size = 7 * r;
  const [x, y] = map.toScreen(stalest[0], stalest[1]);
  for (const [colour, wide] of [["#ffffff", 5], ["#14171b", 2]]) {
    c.lineJoin = "miter";
    c.strokeStyle = colour;
    c.lineWidth = wide * r;
    c.beginPath();
    c.moveTo(x, y - size);
    c.lineTo(x + size, y);
    c.lineTo(x, y + size);
    c.lineTo(x - size, y);
    c.closePath();
    c.stroke();
  }
  labelMark(map, STALEST, stalestAge(stalest), x, y, size);
}

function footprint(map, [status, , pose], facts, place) {
  if (!pose || status !== 1 || !inFull(map, place)) return;
  const c = map.context;
  const { point, width, height, origin } = map.store.facts;
  const { terrain, shut } = map.store;
  const half = (facts.angle * Math.PI) / 360, whole = facts.angle >= 360;
  c.beginPath();
  for (let i = 0; i <= RAYS; i++) {
    const angle = whole ? (i / RAYS) * 2 * Math.PI : pose[2] - half + (i / RAYS) * 2 * half;
    const dx = Math.cos(angle), dy = Math.sin(angle);
    let reach = 0;
    for (; reach < facts.range; reach += point) {
      const col = Math.floor((pose[0] + dx * reach - origin[0]) / point);
      const row = Math.floor((pose[1] + dy * reach - origin[1]) / point);
      if (col < 0 || row < 0 || col >= width || row >= height) break;
      const at = row * width + col;
      if (!(terrain[at] & PASSABLE) || shut.has(at)) break;
    }
    const [x, y] = map.toScreen(pose[0] + dx * Math.min(reach, facts.range), pose[1] + dy * Math.min(reach, facts.range));
    if (i) c.lineTo(x, y);
    else if (whole) c.moveTo(x, y);
    else {
      c.moveTo(...map.toScreen(pose[0], pose[1]));
      c.lineTo(x, y);
    }
  }
  c.closePath();
  const chosen = place === map.selected;
  c.lineWidth = (chosen ? 2 : 1) * map.ratio;
  c.strokeStyle = chosen ? "rgb(255 255 255 / 90%)" : "rgb(20 24 30 / 40%)";
  c.stroke();
}

function inFull(map, place) {
  return map.store.facts.robots.length <= MANY || place === map.selected;
}

function trail(map, place) {
  const full = inFull(map, place), rows = full ? map.store.trail.rows : map.store.trail.rows.slice(-SHORT);
  const c = map.context;
  let before = null;
  c.beginPath();
  for (const row of rows) {
    const x = row[2 * place], y = row[2 * place + 1];
    if (x === null) before = null;
    else if (before === null) c.moveTo(...map.toScreen(x, y));
    else if (before[0] !== x || before[1] !== y) c.lineTo(...map.toScreen(x, y));
    if (x !== null) before = [x, y];
  }
  if (full) {
    c.strokeStyle = "rgb(255 255 255 / 55%)";
    c.lineWidth = (place === map.selected ? 4 : 3) * map.ratio;
    c.stroke();
  }
  c.strokeStyle = ROBOTS[place % ROBOTS.length];
  c.lineWidth = (place === map.selected ? 2.4 : 1.4) * map.ratio;
  c.stroke();
}

function goal(map, [status, , pose, goal], place) {
  if (!goal || !pose || status !== 1 || !inFull(map, place)) return;
  const c = map.context, r = map.ratio;
  const [x0, y0] = map.toScreen(pose[0], pose[1]), [x, y] = map.toScreen(goal[0], goal[1]);
  for (const [colour, wide] of [["rgb(255 255 255 / 70%)", 3.4], [ROBOTS[place % ROBOTS.length], 1.6]]) {
    c.strokeStyle = colour;
    c.lineWidth = wide * r;
    c.setLineDash([4 * r, 4 * r]);
    c.beginPath();
    c.moveTo(x0, y0);
    c.lineTo(x, y);
    c.stroke();
    c.setLineDash([]);
    c.beginPath();
    c.moveTo(x - 4 * r, y);
    c.lineTo(x + 4 * r, y);
    c.moveTo(x, y - 4 * r);
    c.lineTo(x, y + 4 * r);
    c.stroke();
  }
}

function body(map, robot, facts, place) {
  const [status, , pose] = robot;
  if (!pose) return;
  const c = map.context, r = map.ratio;
  const [x, y] = map.toScreen(pose[0], pose[1]);
  const size = bodySize(map, facts);
  map.taken.push({ x, half: size, top: y - size, bottom: y + size });
  const gone = status === 3 || status === 4;
  const shown = robotStatus(robot);
  if (place === map.selected) ring(c, x, y, size + 5 * r, map.colours.accent, 3 * r);
  c.beginPath();
  c.arc(x, y, size, 0, 2 * Math.PI);
  c.fillStyle = gone ? "#2b2f36" : ROBOTS[place % ROBOTS.length];
  c.fill();
  c.lineWidth = 2 * r;
  c.strokeStyle = "#ffffff";
  c.stroke();
  ring(c, x, y, size + 1.6 * r, "rgb(0 0 0 / 55%)", r);
  c.strokeStyle = "#ffffff";
  c.lineWidth = Math.max(2 * r, size * 0.18);
  const arm = size * 0.62;
  if (gone) {
    line(c, x - arm, y - arm, x + arm, y + arm);
    line(c, x - arm, y + arm, x + arm, y - arm);
  } else if (status === 2) {
    line(c, x - size * 0.3, y - arm, x - size * 0.3, y + arm);
    line(c, x + size * 0.3, y - arm, x + size * 0.3, y + arm);
  } else {
    const reach = size * 1.55;
    c.strokeStyle = "rgb(0 0 0 / 60%)";
    c.lineWidth += 2 * r;
    line(c, x, y, x + Math.cos(pose[2]) * reach, y - Math.sin(pose[2]) * reach);
    c.strokeStyle = "#ffffff";
    c.lineWidth -= 2 * r;
    line(c, x, y, x + Math.cos(pose[2]) * reach, y - Math.sin(pose[2]) * reach);
  }
  if (status === 1 && robot[6]) {
    ring(c, x, y, size + 5 * r, "#ffffff", 6 * r);
    ring(c, x, y, size + 5 * r, "#c1121f", 3.2 * r);
  } else if (shown.kind === "warn" && status === 1) {
    c.setLineDash([3 * r, 3 * r]);
    ring(c, x, y, size + 4 * r, "#ffffff", 2 * r);
    c.setLineDash([]);
  }
}

/** How far a robot's mark reaches from its centre. */
function bodySize(map, facts) {
  return Math.max(facts.radius * map.scale, LEAST * map.ratio);
}

function intruder(map, px, py) {
  const c = map.context, r = map.ratio, size = 8 * r;
  const [x, y] = map.toScreen(px, py);
  c.beginPath();
  c.moveTo(x, y - size);
  c.lineTo(x + size * 0.9, y + size * 0.7);
  c.lineTo(x - size * 0.9, y + size * 0.7);
  c.closePath();
  c.fillStyle = "#ffffff";
  c.fill();
  c.lineWidth = 2 * r;
  c.strokeStyle = "#c1121f";
  c.stroke();
  line(c, x, y - size * 0.3, x, y + size * 0.15);
}

export function drawCross(map) {
  const c = map.context, r = map.ratio, arm = 14 * r;
  const [x, y] = map.hovered.map((value) => value * r);
  for (const [colour, wide] of [["#ffffff", 5], ["#c1121f", 2]]) {
    c.strokeStyle = colour;
    c.lineWidth = wide * r;
    line(c, x - arm, y, x + arm, y);
    line(c, x, y - arm, x, y + arm);
  }
}

export function drawScaleBar(map) {
  const c = map.context, r = map.ratio, most = (120 * r) / map.scale;
  const power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((step) => step * power).find((step) => step <= most);
  const right = map.canvas.width - 14 * r, y = map.canvas.height - 14 * r, left = right - length * map.scale;
  for (const [colour, wide] of [["rgb(255 255 255 / 85%)", 5], ["#14171b", 2]]) {
    c.strokeStyle = colour;
    c.lineWidth = wide * r;
    line(c, left, y, right, y);
  }
  label(c, `${length} m`, right, y - 4 * r, "right", r);
}

/** Ask for a label beside a mark that reaches so far; `drawLabels` draws it. */
function labelMark(map, rank, text, x, y, reach) {
  map.labels.push({ rank, text, x, y, reach });
}

/**
 * Draw the labels, those of the lowest rank first: above or below its mark (the stalest point's below or above), right or
 * left of it, the first place where it lies on the map and covers no robot and no other label. Where there is none, a
 * zone or closure has no label; a robot and the stalest point may then cover a robot's body, but no label.
 */
export function drawLabels(map) {
  const { context: c, ratio: r, canvas: { width, height }, taken, labels } = map, drawn = [];
  c.font = font(r);
  for (const { rank, text, x, y, reach } of labels.sort((one, other) => one.rank - other.rank)) {
    if (x < -reach || x > width + reach || y < -reach || y > height + reach) continue;
    const away = reach + r, line = LINE * r, half = 0.5 * c.measureText(text).width + 2 * r;
    const middle = Math.max(half, Math.min(x, width - half));
    const over = [middle, y - away], under = [middle, y + away + line], beside = y + 0.5 * line;
    const places = [...(rank === STALEST ? [under, over] : [over, under]), [x + away + half, beside], [x - away - half, beside]]
      .map(([x, bottom]) => ({ x, half, bottom, top: bottom - line }))
      .filter((box) => box.top >= 0 && box.bottom <= height && box.x >= half && box.x <= width - half);
    const isFree = (box, others) => !others.some((other) => overlap(box, other));
    const place = places.find((box) => isFree(box, [...taken, ...drawn])) ??
      (rank === MARK ? undefined : places.find((box) => isFree(box, drawn)));
    if (!place) continue;
    drawn.push(place);
    label(c, text, place.x, place.bottom, "center", r);
  }
}

function overlap(one, other) {
  return Math.abs(one.x - other.x) < one.half + other.half && one.top < other.bottom && other.top < one.bottom;
}

function font(r) {
  return `${11.5 * r}px system-ui, "DejaVu Sans", sans-serif`;
}

function label(c, text, x, y, align, r) {
  c.font = font(r);
  c.textAlign = align;
  c.textBaseline = "bottom";
  c.lineWidth = 3 * r;
  c.strokeStyle = "rgb(255 255 255 / 90%)";
  c.fillStyle = "#14171b";
  c.strokeText(text, x, y);
  c.fillText(text, x, y);
}

function ring(c, x, y, size, colour, wide) {
  c.beginPath();
  c.arc(x, y, size, 0, 2 * Math.PI);
  c.lineWidth = wide;
  c.strokeStyle = colour;
  c.stroke();
}

function line(c, x0, y0, x1, y1) {
  c.beginPath();
  c.moveTo(x0, y0);
  c.lineTo(x1, y1);
  c.stroke();
}
