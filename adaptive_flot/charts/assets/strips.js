/* Rows of states over time: a kind of panel of chart.js. */
AdaptiveFlotChart.kinds.strips = (chart, spec, last) => {
  "use strict";
  const { frame, tip, colour } = AdaptiveFlotChart.parts;
  const ROW = 40; // height of a row with its name above [px]
  const NARROWEST = 2; // a second in a day is still seen [px]

  const draw = (u) => {
    const { ctx, bbox } = u;
    const px = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.font = `${12 * px}px system-ui, sans-serif`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    spec.rows.forEach((row, k) => {
      const top = bbox.top + k * ROW * px;
      ctx.fillStyle = colour("ink");
      ctx.fillText(row.label, bbox.left + 2 * px, top + 14 * px);
      for (const pass of [true, false]) {
        for (const [, from, to, color] of row.spells) {
          if ((color === "usual") !== pass) continue;
          const start = u.valToPos(from, "x", true);
          const width = u.valToPos(to, "x", true) - start;
          ctx.fillStyle = colour(color);
          ctx.fillRect(start, top + 19 * px, Math.max(width, NARROWEST * px), 15 * px);
        }
      }
    });
    ctx.restore();
  };
  const tell = (u) => {
    const at = u.posToVal(u.cursor.left, "x");
    const told = spec.rows.map((row) => {
      const spell = row.spells.find(([, from, to]) => from < at && at <= to);
      return [row.label, spell ? spell[0] : "–", spell ? colour(spell[3]) : "transparent"];
    });
    tip(u, chart, told);
  };
  const options = frame(chart, ROW * spec.rows.length + 8, last, {
    series: [{ show: true, stroke: "transparent", points: { show: false } }],
    bands: [],
    y: { range: () => [0, 1] },
    axis: { values: (u, splits) => splits.map(() => ""), grid: { show: false }, ticks: { show: false } },
    cursor: { points: { show: false } },
    under: [],
    over: [draw],
    tell,
  });
  const entries = spec.states.map(([color, label]) => ({ label, color, area: true, fixed: true }));
  return { options, data: [chart.spec.x.range, [null, null]], panel: { entries } };
};
