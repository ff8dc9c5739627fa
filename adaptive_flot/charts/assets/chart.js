/* Charts over time from JSON blocks, drawn by uPlot: zoom, values under the pointer, lines on and off, linked axes.
 *
 *   AdaptiveFlotChart.start()              draw each div.chart of the page when it comes into view
 *   AdaptiveFlotChart.make(element, block) draw one now; returns it
 *   chart.append(panel, times, rows)       add points at the end: rows[i] are the values of line i, null for none
 *   chart.renew(range, tables)             all points anew: for each panel its times, then the values of each line
 *   AdaptiveFlotChart.recolour()           after the colours of the page have changed
 *
 * The block is described in adaptive_flot/charts/__init__.py. No text of it is ever read as HTML. */
const AdaptiveFlotChart = (() => {
  "use strict";
  const { element, decode, number, moment, clock } = AdaptiveFlotText;
  const MOST_LIVE = 20000; // points of a line that grows
  const AXIS = 68; // width of the vertical axis [px]
  const STEPS = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400];
  const TIME_STEPS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, ...STEPS, ...[2, 5, 10, 20, 50, 100, 200].map((d) => d * 86400)];
  const charts = [];
  let linked = null; // range of the linked axes, null: each shows all
  let linking = false;
  let colours = {};

  const colour = (name) => (colours[name] ??= getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim());

  /* The axes and the pointer that panels of lines and of strips have in common. */
  function frame(chart, height, last, more) {
    const { x } = chart.spec;
    const axis = {
      stroke: () => colour("ink"),
      grid: { stroke: () => colour("grid"), width: 1 },
      ticks: { stroke: () => colour("grid"), width: 1, size: 5 },
      font: "12px system-ui, sans-serif",
    };
    const across = {
      ...axis,
      size: last ? 34 : 8,
      space: 64,
      values: (u, splits) => {
        if (!last) return splits.map(() => "");
        const step = splits.length > 1 ? splits[1] - splits[0] : 0;
        return splits.map((v) => (x.clock ? clock(v, step) : number(v / x.seconds, step / x.seconds)));
      },
    };
    if (x.time) across.incrs = TIME_STEPS;
    return {
      width: chart.width(),
      height: height + (last ? 34 : 8),
      padding: [8, 20, 0, 0],
      legend: { show: false },
      cursor: {
        y: false,
        drag: { x: true, y: false, setScale: true },
        sync: { key: x.time ? "time" : chart.key, scales: ["x", null], setSeries: false },
        ...more.cursor,
      },
      scales: { x: { time: false, range: (u, low, high) => (low === null || (low === u.data[0][0] && high === u.data[0].at(-1)) ? chart.spec.x.range : [low, high]) }, y: more.y },
      axes: [across, { ...axis, size: AXIS, space: 26, ...more.axis }],
      series: [{}, ...more.series],
      bands: more.bands,
      hooks: {
        drawClear: more.under,
        draw: [...more.over, (u) => drawMarks(u, chart)],
        setCursor: [more.tell],
        setScale: [(u, key) => key === "x" && follow(chart, u)],
      },
    };
  }

  /* A zoom in one panel is the zoom of its chart, and of every other chart over time. */
  function follow(chart, u) {
    if (linking || !chart.ready) return;
    const { min, max } = u.scales.x;
    if (min !== chart.view[0] || max !== chart.view[1]) chart.zoom(min, max);
  }

  function drawMarks(u, chart) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const mark of chart.spec.marks) {
      ctx.strokeStyle = colour(mark.color ?? "limit");
      const at = Math.round(u.valToPos(mark.x, "x", true));
      if (at < bbox.left || at > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(at, bbox.top);
      ctx.lineTo(at, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  function tip(u, chart, entries) {
    const box = u.tip;
    const at = u.cursor.left;
    box.hidden = at === undefined || at < 0 || !entries.length;
    if (box.hidden) return;
    box.replaceChildren(element("div", "at", moment(chart.spec.x, u.posToVal(at, "x"))));
    for (const [name, value, color] of entries) {
      const row = element("div", "");
      const dot = element("i", "dot");
      dot.style.background = color;
      row.append(dot, element("span", "", name), element("b", "", value));
      box.append(row);
    }
    box.classList.toggle("left", at > u.over.clientWidth / 2);
  }

  class Chart {
    constructor(host, spec) {
      this.host = host;
      this.spec = spec;
      this.key = "chart-" + charts.length;
      this.plots = [];
      this.off = new Set();
      this.view = spec.x.range;
      this.ready = false;
      host.querySelectorAll(":scope > :not(script):not(noscript)").forEach((old) => old.remove());
      const bar = element("div", "chart-bar");
      host.append(bar);
      this.panels = spec.panels.map((panel, k) => this.panel(panel, k === spec.panels.length - 1));
      this.legend(bar);
      host.append(element("div", "chart-x", `${spec.x.label}${spec.x.unit === "–" ? "" : ` [${spec.x.unit}]`}`));
      this.ready = true;
      charts.push(this);
      new ResizeObserver(() => this.resize()).observe(host);
      if (spec.x.time && linked) this.show(...linked);
    }

    width() {
      return Math.max(240, Math.floor(this.host.clientWidth));
    }

    panel(spec, last) {
      const box = element("div", "panel");
      if (spec.label) {
        const head = element("div", "panel-head", spec.label + " ");
        head.append(element("span", "unit", `[${spec.unit}]`));
        box.append(head);
      }
      this.host.append(box);
      const { options, data, panel } = AdaptiveFlotChart.kinds[spec.kind](this, spec, last);
      const plot = new uPlot(options, data, box);
      plot.tip = element("div", "tip");
      plot.tip.hidden = true;
      plot.over.append(plot.tip);
      this.plots.push(plot);
      return panel;
    }

    legend(bar) {
      const seen = new Map();
      for (const panel of this.panels) for (const entry of panel.entries) if (entry.label && !seen.has(entry.label)) seen.set(entry.label, entry);
      if (seen.size > 1 || this.spec.panels.some((p) => p.kind === "strips" || p.band || (p.limits ?? []).length)) {
        for (const entry of seen.values()) bar.append(this.name(entry));
      }
      const tools = element("div", "chart-tools");
      for (const [text, title, act] of [
        ["+", "Zoom in", () => this.scaleBy(0.5)],
        ["−", "Zoom out", () => this.scaleBy(2)],
        ["All", "Show all", () => this.zoom(...this.spec.x.range)],
      ]) {
        const button = element("button", "", text);
        button.type = "button";
        button.title = title;
        button.setAttribute("aria-label", title);
        button.addEventListener("click", act);
        tools.append(button);
      }
      bar.append(tools);
    }

    name(entry) {
      const made = element(entry.fixed ? "span" : "button", "name");
      const line = element("i", entry.area ? "area" : "line");
      line.style.setProperty("--own", `var(--${entry.color})`);
      if ((entry.dash ?? []).length) line.classList.add(entry.dash[0] > 4 ? "dashed" : "dotted");
      made.append(line, element("span", "", entry.label));
      if (entry.fixed) return made;
      made.type = "button";
      made.title = "Show or hide";
      made.setAttribute("aria-pressed", "true");
      made.addEventListener("click", () => {
        const hidden = !this.off.delete(entry.label) && !!this.off.add(entry.label);
        made.setAttribute("aria-pressed", String(!hidden));
        this.panels.forEach((panel, k) => panel.toggle?.(this.plots[k], entry.label, !hidden));
      });
      return made;
    }

    scaleBy(factor) {
      const { min, max } = this.plots[0].scales.x;
      const middle = (min + max) / 2;
      const half = ((max - min) / 2) * factor;
      const [low, high] = this.spec.x.range;
      this.zoom(Math.max(low, middle - half), Math.min(high, middle + half));
    }

    zoom(min, max) {
      const [low, high] = this.spec.x.range;
      const all = min <= low && max >= high;
      if (!this.spec.x.time) return this.show(min, max);
      linked = all ? null : [min, max];
      for (const other of charts) if (other.spec.x.time) other.show(...(linked ?? other.spec.x.range));
    }

    show(min, max) {
      this.view = [min, max];
      linking = true;
      for (const plot of this.plots) plot.batch(() => plot.setScale("x", { min, max }));
      linking = false;
    }

    resize(width = this.width()) {
      for (const plot of this.plots) if (plot.width !== width) plot.setSize({ width, height: plot.height });
    }

    /* Points at the end of a panel whose lines share their times; a chart that shows the newest values goes along. */
    append(which, times, rows) {
      const plot = this.plots[which];
      const data = plot.data.map((column, k) => [...column, ...(k ? rows[k - 1] : times)].slice(-MOST_LIVE));
      const { min, max } = plot.scales.x;
      const before = this.spec.x.range;
      const newest = data[0].at(-1);
      this.spec.x.range = [Math.min(before[0], data[0][0]), newest];
      linking = true;
      plot.batch(() => plot.setData(data, false));
      linking = false;
      if (max < before[1]) return;
      this.show(min <= before[0] ? this.spec.x.range[0] : min + newest - max, newest);
    }

    /* All points anew; a chart that shows all goes along, one that is zoomed stays where it is. */
    renew(range, tables) {
      const [low, high] = this.spec.x.range;
      const all = this.view[0] <= low && this.view[1] >= high;
      this.spec.x.range = range;
      linking = true;
      tables.forEach((table, k) => this.plots[k].batch(() => this.plots[k].setData(table, false)));
      linking = false;
      this.show(...(all ? range : this.view));
    }
  }

  function make(host, spec) {
    return new Chart(host, spec);
  }

  function draw(host) {
    if (host.dataset.drawn) return;
    host.dataset.drawn = "yes";
    make(host, JSON.parse(host.querySelector('script[type="application/json"]').textContent));
  }

  function start(root = document) {
    const seen = new IntersectionObserver((found) => found.forEach((f) => f.isIntersecting && draw(f.target)), { rootMargin: "400px" });
    root.querySelectorAll("div.chart").forEach((host) => seen.observe(host));
  }

  function recolour() {
    colours = {};
    for (const chart of charts) for (const plot of chart.plots) plot.redraw(false, true);
  }

  const all = () => document.querySelectorAll("div.chart").forEach(draw);
  return { start, make, recolour, all, charts, kinds: {}, parts: { frame, tip, colour } };
})();
