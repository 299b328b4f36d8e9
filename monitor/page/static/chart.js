// MFoW and mean fog over time, with the faults as bands. Plotly comes from its Python package.

import { themed } from "./colours.js";

const MOST = 1200;
const EVERY_MS = 500;

export class Chart {
  /** seek(k): called when the chart is clicked. */
  constructor(box, store, seek) {
    this.box = box;
    this.store = store;
    this.seek = seek;
    this.due = 0;
    this.drawn = false;
    this.timer = 0;
    this.loading = null;
  }

  /** Draw soon, at most every EVERY_MS. */
  renew() {
    if (this.timer) return;
    this.timer = setTimeout(() => {
      this.timer = 0;
      this.due = performance.now() + EVERY_MS;
      this.loading ??= load();
      this.loading.then(() => this.#draw());
    }, Math.max(this.due - performance.now(), 0));
  }

  #draw() {
    const { store, box } = this;
    if (!store.facts || !store.series.k.length) return;
    const colours = themed();
    const step = store.facts.step;
    const rows = thinned(store.series);
    const time = rows.map((i) => store.series.k[i] * step);
    const line = (name, values, colour, width) => ({
      type: "scatter", mode: "lines", name, x: time, y: rows.map((i) => values[i]),
      line: { color: colour, width }, hovertemplate: "%{y:.1f} s",
    });
    const traces = [
      line("MFoW", store.series.mfow, colours.accent, 1.8),
      line("mean fog", store.series.mean, colours.mean, 1.6),
    ];
    const axis = {
      gridcolor: colours.grid, zerolinecolor: colours.grid, linecolor: colours.grid, tickfont: { size: 11, color: colours.muted },
      title: { font: { size: 11, color: colours.muted }, standoff: 4 }, fixedrange: true,
    };
    const end = Math.max(store.facts.live ? time[time.length - 1] : store.facts.ticks * step, store.shared.end);
    const height = store.shared.stalest ? { range: [0, 1.05 * store.oldest] } : { rangemode: "tozero" };
    const layout = {
      margin: { l: 44, r: 16, t: 26, b: 36 }, paper_bgcolor: "transparent", plot_bgcolor: "transparent",
      font: { family: "system-ui, DejaVu Sans, sans-serif", color: colours.ink }, hovermode: "x unified", showlegend: true,
      hoverlabel: { bgcolor: colours.card, bordercolor: colours.grid, font: { color: colours.ink } },
      legend: { orientation: "h", x: 0, y: 1.16, font: { size: 11.5 } },
      xaxis: { ...axis, title: { ...axis.title, text: "time (s)" }, range: [0, Math.max(end, 10)] },
      yaxis: { ...axis, title: { ...axis.title, text: "fog (s)" }, ...height },
      shapes: this.#shapes(colours), uirevision: "same",
    };
    const config = { displayModeBar: false, responsive: true };
    window.Plotly.react(box, traces, layout, config);
    if (!this.drawn) {
      this.drawn = true;
      box.on("plotly_click", (event) => this.seek(Math.round(event.points[0].x / step)));
    }
  }

  #shapes(colours) {
    const { store } = this;
    const shapes = store.bands.slice(-60).map(([, , begin, end]) => ({
      type: "rect", xref: "x", yref: "paper", x0: begin, x1: end, y0: 0, y1: 1, layer: "below",
      fillcolor: colours.dark ? "rgba(255,122,128,0.14)" : "rgba(193,18,31,0.10)",
      line: { width: end > begin ? 0 : 1.2, color: colours.alert },
    }));
    if (!store.facts.live && store.state) {
      const now = store.state.time;
      shapes.push({ type: "line", xref: "x", yref: "paper", x0: now, x1: now, y0: 0, y1: 1, line: { color: colours.ink, width: 1.4, dash: "dot" } });
    }
    return shapes;
  }
}

/** Indices of the rows to draw: all or, of each interval, the first one and the one with the largest MFoW. */
function thinned({ k, mfow }) {
  if (k.length <= MOST) return k.map((_, i) => i);
  const rows = [], size = (2 * k.length) / MOST;
  for (let first = 0; first < k.length; first += size) {
    const from = Math.floor(first), to = Math.min(Math.floor(first + size), k.length);
    let worst = from;
    for (let i = from; i < to; i++) if (mfow[i] > mfow[worst]) worst = i;
    rows.push(from);
    if (worst !== from) rows.push(worst);
  }
  if (rows[rows.length - 1] !== k.length - 1) rows.push(k.length - 1);
  return rows;
}

function load() {
  return new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = "plotly.min.js";
    script.onload = done;
    script.onerror = failed;
    document.head.append(script);
  });
}
