/* Lines over a common axis: a kind of panel of chart.js. */
AdaptiveFlotChart.kinds.lines = (chart, spec, last) => {
  "use strict";
  const { frame, tip, colour } = AdaptiveFlotChart.parts;
  const { decode, number } = AdaptiveFlotText;
  const FINEST = 3e-4; // smallest range of an axis, as a share of its numbers
  const FAR = 2000; // rows from the pointer within which a value is looked for
  const axes = spec.x.map(decode);
  const tables = axes.map((x) => [x]);
  const series = spec.x.map(() => []);
  const bands = [];
  for (const s of spec.series) {
    const y = decode(s.y);
    tables[s.x].push(y);
    series[s.x].push({ of: s, options: { label: s.label, stroke: () => colour(s.color), width: s.width, dash: s.dash, points: { show: false }, ...(s.step ? { paths: uPlot.paths.stepped({ align: -1 }) } : {}) } });
    if (!s.std) continue;
    const std = decode(s.std);
    for (const side of [1, -1]) {
      tables[s.x].push(y.map((v, k) => (v === null || std[k] === null ? null : v + side * 2 * std[k])));
      series[s.x].push({ of: s, edge: side, options: { label: s.label, stroke: "transparent", width: 0, points: { show: false } } });
    }
  }
  const flat = series.flat();
  const data = tables.length > 1 ? uPlot.join(tables) : tables[0] ?? [[]];
  flat.forEach((one, k) => one.edge === 1 && bands.push({ series: [k + 1, k + 2], fill: () => colour(one.of.color) + "38" }));
  const extra = [...spec.limits, ...(spec.band ? [spec.band.half, -spec.band.half] : [])];
  const entries = spec.series.map((s) => ({ label: s.label, color: s.color, dash: s.dash }));
  if (spec.limits.length) entries.push({ label: "limit", color: "limit", dash: [7, 3], fixed: true });
  if (spec.band) entries.push({ label: spec.band.label, color: "band", area: true, fixed: true });

  const range = (u, low, high) => {
    if (spec.range) return spec.range;
    const ends = [...(low === null ? [] : [low, high]), ...extra];
    if (!ends.length) return [0, 1];
    const [least, most] = [Math.min(...ends), Math.max(...ends)];
    const finest = FINEST * Math.max(Math.abs(least), Math.abs(most)); // ticks of a smaller range would not fit beside it
    const room = most === least ? Math.abs(most) * 0.05 || 1 : Math.max(0.06 * (most - least), (finest - (most - least)) / 2);
    return [least - room, most + room];
  };
  const under = (u) => {
    if (!spec.band) return;
    const [top, bottom] = [spec.band.half, -spec.band.half].map((v) => u.valToPos(v, "y", true));
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    u.ctx.fillStyle = colour("band");
    u.ctx.fillRect(u.bbox.left, top, u.bbox.width, bottom - top);
    u.ctx.restore();
  };
  const over = (u) => {
    u.ctx.save();
    u.ctx.strokeStyle = colour("limit");
    u.ctx.lineWidth = devicePixelRatio;
    u.ctx.setLineDash([7 * devicePixelRatio, 3 * devicePixelRatio]);
    for (const limit of spec.limits) {
      const at = Math.round(u.valToPos(limit, "y", true));
      u.ctx.beginPath();
      u.ctx.moveTo(u.bbox.left, at);
      u.ctx.lineTo(u.bbox.left + u.bbox.width, at);
      u.ctx.stroke();
    }
    u.ctx.restore();
  };
  /* The value at the pointer, or the nearest one where this line has none at that time. */
  const nearest = (u, k, at) => {
    const column = u.data[k];
    if (column[at] !== undefined) return at;
    for (let d = 1; d < column.length; d++) {
      if (column[at - d] !== undefined) return at - d;
      if (column[at + d] !== undefined) return at + d;
      if (d > FAR) break;
    }
    return at;
  };
  const tell = (u) => {
    const told = [];
    flat.forEach((one, k) => {
      if (one.edge || !u.series[k + 1].show || u.cursor.idx === null || u.cursor.idx === undefined) return;
      const value = u.data[k + 1][nearest(u, k + 1, u.cursor.idx)];
      if (value === undefined || (value === null && one.of.color === "plan")) return;
      told.push([one.of.label || spec.label, number(value), colour(one.of.color)]);
    });
    tip(u, chart, told);
  };
  const options = frame(chart, Math.round(150 * Math.max(0.6, spec.height)), last, {
    series: flat.map((one) => one.options),
    bands,
    y: { range },
    axis: { values: (u, splits) => splits.map((v) => number(v, splits.length > 1 ? splits[1] - splits[0] : 0)) },
    cursor: { dataIdx: (u, k, at) => (k ? nearest(u, k, at) : at), points: { size: 6 } },
    under: [under],
    over: [over],
    tell,
  });
  const toggle = (plot, label, shown) => flat.forEach((one, k) => one.of.label === label && plot.setSeries(k + 1, { show: shown }));
  return { options, data, panel: { entries, toggle } };
};
