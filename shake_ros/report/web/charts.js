"use strict";
// Draws every chart of a report with uPlot; panels of one chart zoom and point together. No build step, no network.
(() => {
  const root = document.documentElement;
  const charts = [];
  const PRINTED = 690; // width of a printed page [CSS pixel]

  const probe = document.body.appendChild(document.createElement("i"));
  probe.hidden = true;
  const colour = (name) => {
    probe.style.color = `var(--${name})`;
    return getComputedStyle(probe).color;
  };
  const number = (v) => (v == null ? "–" : String(Number(v.toPrecision(4))).replace("-", "−"));

  function unpack(column) {
    if (Array.isArray(column)) return column;
    if ("count" in column) return Array.from({ length: column.count }, (_, i) => column.start + i * column.step);
    const bytes = Uint8Array.from(atob(column.data), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Array.from({ length: bytes.length / 2 }, (_, i) => {
      const step = view.getInt16(2 * i, true);
      return step === -32768 ? null : column.low + (step + 32767) * column.step;
    });
  }

  function values(series, columns) {
    const main = columns[series.values];
    if (series.minus == null) return main;
    const less = columns[series.minus];
    return main.map((v, i) => (v == null || less[i] == null ? null : v - less[i]));
  }

  const loose = (series) => series.kind === "points" || series.kind === "rings";

  // a band that is shown is in the range, with room around it; nothing but zeros lies on an axis from 0 to 1
  function range(panel) {
    if (panel.shaded)
      return (u, low, high) => [Math.min(low, 1.4 * panel.shaded[0]), Math.max(high, 1.4 * panel.shaded[1])];
    if (panel.log) return undefined;
    const end = { pad: 0.1, soft: 0, mode: 3 };
    return (u, low, high) => {
      if (low == null) return [null, null];
      return low === 0 && high === 0 ? [0, 1] : uPlot.rangeNum(low, high, { min: end, max: end });
    };
  }

  function shade(u, chart, panel) {
    const c = u.ctx, box = u.bbox;
    c.save();
    c.fillStyle = colour("grey");
    c.globalAlpha = 0.2;
    c.beginPath();
    c.rect(box.left, box.top, box.width, box.height);
    c.clip();
    for (const [from, to] of chart.shaded) {
      const left = u.valToPos(from, "x", true);
      c.fillRect(left, box.top, u.valToPos(to, "x", true) - left, box.height);
    }
    if (panel.shaded) {
      const top = u.valToPos(panel.shaded[1], "y", true);
      c.fillRect(box.left, top, box.width, u.valToPos(panel.shaded[0], "y", true) - top);
    }
    c.restore();
  }

  // Of a logarithmic axis the places 1, 2 and 5 of each decade.
  const round = (u, at) => at.map((v) => (/^[125](\.0*)?e/.test(v.toExponential()) ? v : null));

  // Over more than three decades their lines alone: all nine of each are a hatching.
  const decades = (u, at) => (at.length > 30 ? at.map((v) => (/^1(\.0*)?e/.test(v.toExponential()) ? v : null)) : at);

  function options(spec, panel, chart, last) {
    const places = Object.keys(spec.ticks).map(Number).sort((a, b) => a - b);
    const axis = (more) => ({
      stroke: () => colour("quiet"),
      grid: { stroke: () => colour("line"), width: 1 },
      ticks: { stroke: () => colour("line"), width: 1 },
      font: "12px system-ui, sans-serif",
      labelFont: "12px system-ui, sans-serif",
      ...more,
    });
    const named = places.length
      ? { splits: () => places, values: (u, at) => at.map((v) => spec.ticks[String(v)] ?? "") }
      : { values: (u, at) => at.map((v) => (v == null || !last ? "" : number(v))) };
    return {
      width: 600,
      height: panel.height + (last ? 38 : 0),
      scales: { x: { time: false, distr: spec.log ? 3 : 1, range: (u, low, high) => [low, high] }, y: { distr: panel.log ? 3 : 1, range: range(panel) } },
      axes: [
        axis({ ...named, ...(spec.log ? { filter: round } : {}), ...(last ? { label: spec.x, labelSize: 18, size: 28 } : { size: 8 }) }),
        axis({ ...(panel.log ? { grid: { stroke: () => colour("line"), width: 1, filter: decades } } : {}), label: panel.y, labelSize: 18, size: 66, space: 24, values: (u, at) => at.map((v) => (v == null ? "" : number(v))) }),
      ],
      series: [
        { label: spec.x, value: (u, v) => number(v) },
        ...panel.series.map((s) => ({
          label: s.label,
          stroke: () => colour(s.colour),
          width: loose(s) ? 0 : s.width,
          dash: s.kind === "dashed" ? [6, 3] : undefined,
          paths: loose(s) ? () => null : undefined,
          points: s.kind === "rings" ? { show: true, size: 12, width: 2, fill: "transparent" }
            : loose(s) || s.kind === "marks" ? { show: true, size: 7, fill: () => colour(s.colour) } : { show: false },
          value: (u, v) => number(v),
          spanGaps: false,
        })),
      ],
      bands: panel.band ? [{ series: panel.band.map((i) => i + 1), fill: () => colour("band") }] : undefined,
      legend: { markers: { stroke: (u, i) => (i ? `var(--${panel.series[i - 1].colour})` : "transparent"),
        fill: (u, i) => (i ? `var(--${panel.series[i - 1].colour})` : "transparent") } },
      cursor: { drag: { x: true, y: false }, sync: { key: spec.name }, points: { size: 6 } },
      hooks: {
        drawClear: [(u) => shade(u, spec, panel)],
        setScale: [(u, key) => { if (key === "x") chart.follow(u); }],
      },
    };
  }

  class Chart {
    constructor(figure) {
      this.figure = figure;
      this.place = figure.querySelector(".plots");
      this.spec = JSON.parse(figure.querySelector("script").textContent);
      this.columns = this.spec.columns.map(unpack);
      this.busy = true;
      this.plots = this.spec.panels.map((panel, i) => {
        const data = [this.columns[panel.x], ...panel.series.map((s) => values(s, this.columns))];
        return new uPlot(options(this.spec, panel, this, i === this.spec.panels.length - 1), data, this.place);
      });
      const ends = this.spec.panels.map((p) => this.columns[p.x]).filter((x) => x.length);
      const pad = Object.keys(this.spec.ticks).length ? 0.5 : 0;
      this.whole = [Math.min(...ends.map((x) => x[0])) - pad, Math.max(...ends.map((x) => x[x.length - 1])) + pad];
      this.view = this.spec.view ?? this.whole;
      this.busy = false;
      this.resize();
      this.zoom(...this.view);
      figure.addEventListener("click", (event) => this.pressed(event.target.dataset.do));
      this.place.addEventListener("dblclick", () => this.zoom(...this.whole));
    }

    follow(source) {
      if (this.busy) return;
      const { min, max } = source.scales.x;
      this.zoom(min, max, source);
    }

    zoom(min, max, source) {
      this.busy = true;
      for (const u of this.plots) if (u !== source) u.setScale("x", { min, max });
      this.busy = false;
    }

    pressed(what) {
      if (!what) return;
      if (what === "csv") return this.save();
      if (what === "whole") return this.zoom(...this.whole);
      if (what === "view") return this.zoom(...this.view);
      const { min, max } = this.plots[0].scales.x;
      const log = this.spec.log, from = log ? Math.log(min) : min, to = log ? Math.log(max) : max;
      const back = (v) => (log ? Math.exp(v) : v), span = to - from;
      const move = { in: [0.25, -0.25], out: [-0.5, 0.5], left: [-0.5, -0.5], right: [0.5, 0.5] }[what];
      const clip = (v) => Math.min(Math.max(v, this.whole[0]), this.whole[1]);
      const ends = [clip(back(from + move[0] * span)), clip(back(to + move[1] * span))];
      if (ends[0] < ends[1]) this.zoom(...ends);
    }

    csv() {
      const blocks = [];
      let seen;
      for (const panel of this.spec.panels) {
        if (panel.x !== seen) blocks.push([this.spec.x, this.columns[panel.x]]);
        seen = panel.x;
        for (const s of panel.series) blocks.push([`${s.label}: ${panel.y}`, values(s, this.columns)]);
      }
      const quoted = (text) => (/[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
      const rows = [blocks.map(([name]) => quoted(name)).join(",")];
      const length = Math.max(...blocks.map(([, column]) => column.length));
      for (let i = 0; i < length; i++) {
        rows.push(blocks.map(([, c]) => (c[i] == null ? "" : String(Number(c[i].toPrecision(9))))).join(","));
      }
      return rows.join("\n") + "\n";
    }

    save() {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([this.csv()], { type: "text/csv" }));
      link.download = `${this.spec.name}.csv`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    }

    resize(width = this.place.clientWidth) {
      this.plots.forEach((u) => u.setSize({ width, height: u.height }));
    }

    redraw() {
      this.plots.forEach((u) => u.redraw(false, true));
    }
  }

  for (const figure of document.querySelectorAll("figure.chart")) charts.push(new Chart(figure));
  window.reportCharts = charts;

  const all = (what) => charts.forEach((chart) => chart[what]());
  let waiting = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => all("resize"));
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => all("redraw"));
  document.querySelector("#theme").addEventListener("click", () => {
    const dark = getComputedStyle(root).colorScheme === "dark" ||
      (!root.dataset.theme && matchMedia("(prefers-color-scheme: dark)").matches);
    root.dataset.theme = dark ? "light" : "dark";
    all("redraw");
  });
  let theme;
  addEventListener("beforeprint", () => {
    theme = root.dataset.theme;
    root.dataset.theme = "light";
    charts.forEach((chart) => { chart.resize(PRINTED); chart.redraw(); });
  });
  addEventListener("afterprint", () => {
    if (theme) root.dataset.theme = theme;
    else delete root.dataset.theme;
    charts.forEach((chart) => { chart.resize(); chart.redraw(); });
  });
  if (innerWidth <= 900) document.querySelector("nav details")?.removeAttribute("open");
})();
