/* The panels over time: the last hour and the plan ahead on one axis; and the strips of solver and analysers. */
const AdaptiveFlotOverTime = (() => {
  "use strict";
  const HOUR = 3600;
  const LEAST_S = 300; // the axis shows this much at least
  const EVERY_MS = 100; // at most ten drawings a second
  const EMPTY = { o: 0, s: 1, v: [] };
  let spec = null;
  let charts = null;
  let times = [];
  let columns = []; // one for each number of a row
  let states = []; // one for each strip
  let plan = null;
  let waiting = false;
  let drawn = 0;

  const cells = (panel) => panel.lines.reduce((sum, line) => sum + 1 + line.band, 0);

  function block() {
    const panels = spec.panels.map((panel) => ({
      kind: "lines",
      label: panel.label,
      unit: panel.unit,
      height: 0.8,
      limits: panel.limits,
      range: null,
      band: null,
      x: [EMPTY],
      series: [
        ...panel.lines.map((line) => ({ label: line.label, x: 0, color: line.color, width: line.dash.length ? 1.25 : 1.5, dash: line.dash, step: line.step, y: EMPTY, ...(line.band ? { std: EMPTY } : {}) })),
        ...(panel.planned ? [{ label: "plan", x: 0, color: "plan", width: 2, dash: [], step: panel.steps, y: EMPTY }] : []),
      ],
    }));
    return { x: { label: "Plant's clock", unit: "–", seconds: 1, time: true, clock: true, range: [0, LEAST_S] }, panels, marks: [] };
  }

  function strips() {
    const rows = spec.strips.map((label) => ({ label, spells: [] }));
    const looks = [["usual", "ok"], ["band", "nothing decided or read"]];
    return { x: { label: "", unit: "–", seconds: 1, time: true, clock: true, range: [0, LEAST_S] }, panels: [{ kind: "strips", rows, states: looks }], marks: [] };
  }

  function begin(told, rows) {
    spec = told;
    const width = 1 + spec.panels.reduce((sum, panel) => sum + cells(panel), 0);
    columns = Array.from({ length: width - 1 }, () => []);
    states = spec.strips.map(() => []);
    times = [];
    plan = null;
    charts ??= { lines: AdaptiveFlotChart.make(document.getElementById("over-time"), block()), strips: AdaptiveFlotChart.make(document.getElementById("strip-chart"), strips()) };
    rows.forEach(take);
    draw();
  }

  function take(row) {
    const time = row[0];
    if (times.length && time <= times.at(-1)) [times, columns, states] = [[], columns.map(() => []), states.map(() => [])];
    if (times.length && time - times.at(-1) > 2.5 * spec.dt) {
      times.push(times.at(-1) + spec.dt); // nothing was seen meanwhile: no line across it
      for (const list of columns) list.push(null);
      for (const list of states) list.push("not read");
    }
    times.push(time);
    columns.forEach((column, k) => column.push(row[k + 1]));
    states.forEach((strip, k) => strip.push(row[k + 1 + columns.length]));
    let old = 0;
    while (times[old] < time - HOUR) old++;
    if (old) for (const list of [times, ...columns, ...states]) list.splice(0, old);
  }

  function show(now, row) {
    if (row) take(row);
    plan = now.plan;
    if (waiting) return;
    waiting = true;
    const rest = Math.max(0, EVERY_MS - (performance.now() - drawn));
    setTimeout(() => requestAnimationFrame(draw), rest);
  }

  /* Numbers of a panel: the last hour, then the plan from the last value on. */
  function table(panel, first, ahead, skipped) {
    const out = [[...times, ...ahead]];
    const none = ahead.map(() => null);
    let at = first;
    for (const line of panel.lines) {
      const values = columns[at++];
      out.push([...values, ...none]);
      if (!line.band) continue;
      const std = columns[at++];
      for (const side of [2, -2]) out.push([...values.map((v, k) => (v === null ? null : v + side * std[k])), ...none]);
    }
    if (panel.planned) {
      const values = plan?.values[panel.name] ?? [...Array(skipped), ...none];
      const last = columns[first].findLast((v) => v !== null) ?? null;
      out.push([...times.map((t, k) => (k === times.length - 1 && plan ? last : null)), ...values.slice(skipped)]);
    }
    return out;
  }

  function spells(strip) {
    const found = [];
    const { usual, looks, other } = spec.states;
    let begun = 0;
    for (let k = 1; k <= strip.length; k++) {
      if (k < strip.length && strip[k] === strip[begun]) continue;
      const word = strip[begun];
      const look = usual.includes(word) ? "usual" : ["no decision", "not read"].includes(word) ? "band" : `state-${looks[word] ?? other}`;
      found.push([word, times[begun] - spec.dt, times[k - 1], look]);
      begun = k;
    }
    return found;
  }

  function draw() {
    waiting = false;
    drawn = performance.now();
    if (!times.length) return;
    const now = times.at(-1);
    const ahead = (plan?.time ?? []).filter((t) => t > now);
    const skipped = (plan?.time.length ?? 0) - ahead.length;
    const range = [Math.max(times[0], now - HOUR), Math.max(ahead.at(-1) ?? now, times[0] + LEAST_S)];
    let first = 0;
    const tables = spec.panels.map((panel) => {
      const made = table(panel, first, ahead, skipped);
      first += cells(panel);
      return made;
    });
    for (const chart of [charts.lines, charts.strips]) chart.spec.marks = [{ x: now, label: "now", color: "soft" }];
    charts.strips.spec.panels[0].rows.forEach((row, k) => (row.spells = spells(states[k])));
    charts.lines.renew(range, tables);
    charts.strips.renew(range, [[range, [null, null]]]);
    document.getElementById("over-time").dataset.newest = String(now);
  }

  return { begin, show };
})();
