/* The head, which is to be read from two metres, and the mode switch. */
const AdaptiveFlotHead = (() => {
  "use strict";
  const POSITIONS = ["off", "monitor", "advisory", "closed"];
  let spec = null;
  let drawn = "";

  const fixed = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits).replace("-", "−"));

  function tile(name, value, unit, note, look = "", what = null) {
    const box = document.getElementById(`tile-${name}`);
    box.className = `tile ${look}`;
    if (what) box.querySelector(".what").textContent = what;
    const shown = box.querySelector(".value");
    shown.replaceChildren(document.createTextNode(value));
    const digits = value.length - (value.includes(".") ? 0.5 : 0); // what has no unit is one of few known words
    shown.classList.toggle("long", Boolean(unit) && digits + (unit.length + 1) / 2 > 6);
    if (unit) shown.append(AdaptiveFlotText.element("span", "unit", ` ${unit}`));
    box.querySelector(".note").textContent = note;
  }

  function grade(now) {
    const g = now.head.grade;
    if (!g) return tile("grade", "–", "", "no limited output");
    const seen = g.measured ?? g.predicted;
    const [limit] = g.limits;
    const low = seen !== null && limit !== undefined && seen < limit;
    const lasts = now.alarms.some((alarm) => alarm.active && alarm.key.startsWith("limit "));
    const source = g.measured === null && seen !== null ? "predicted, not measured; " : "";
    const words = limit === undefined ? "" : `${source}${low ? "below its limit of" : "limit"} ${fixed(limit, 1)} ${g.unit}`;
    const look = seen === null ? "" : lasts ? "bad" : low ? "mild" : "good";
    tile("grade", fixed(seen, 2), g.unit, words, `${look} ${g.measured === null ? "held" : ""}`, g.label);
  }

  function money(rate) {
    const size = Math.abs(rate ?? 0);
    tile("money", fixed(rate, size < 100 ? 2 : size < 1000 ? 1 : 0), rate === null ? "" : "/h", "by the scenario's prices");
  }

  function decides(now) {
    const who = {
      closed: [spec.controller, `${spec.controller} with ${spec.estimator}`, "good"],
      advisory: ["operator", `${spec.controller} advises`, "mild"],
      monitor: ["operator", "the link estimates only", ""],
      off: ["operator", "the link reads nothing", ""],
      shed: ["plant", "control was given back to the plant's own loop", "bad"],
    }[now.mode];
    tile("decides", now.mode, "", now.mode === "closed" ? who[1] : `${who[0]} decides; ${who[1]}`, who[2]);
  }

  function solve(now) {
    const age = now.solver.age;
    const state = now.solver.state;
    const wrong = !["ok", "no decision"].includes(state) && !state.startsWith("solved at the second");
    const long = age !== null && age > 120;
    const value = age === null ? "–" : age < 600 ? Math.round(age) : Math.round(age / 60);
    const unit = age === null ? "" : age < 600 ? "s ago" : "min ago";
    const words = state === "no decision" ? "nothing is decided now" : state === "ok" ? "the last decision is valid" : state;
    tile("solve", String(value), unit, words, wrong ? "bad" : long ? "mild" : "");
  }

  function link(now) {
    const { alive, connected, ms, faults } = now.link;
    const words = !connected ? "lost" : !alive ? "silent" : faults.length ? "faulty" : "good";
    const note = faults.length && connected ? faults[0] : `cycle ${ms === null ? "–" : Math.round(ms)} ms`;
    tile("link", words, "", connected ? note : "no connection to the plant's server", words === "good" ? "good" : "bad");
  }

  function positions(now) {
    const { plant, page, armed, waiting, reason } = now.switch;
    const key = JSON.stringify([plant, page, armed, waiting, reason, now.mode, AdaptiveFlotLive.may()]);
    if (key === drawn) return;
    drawn = key;
    const box = document.getElementById("positions");
    const highest = POSITIONS.indexOf(spec.highest);
    box.replaceChildren(
      ...POSITIONS.map((position, k) => {
        const off = k > highest;
        const made = AdaptiveFlotLive.button(position, () => AdaptiveFlotLive.ask("switch", position), { sure: position === "closed", off });
        made.setAttribute("aria-pressed", String(position === page));
        made.dataset.position = position;
        if (off) made.title = `The link file lets the link go to ${spec.highest}`;
        return made;
      })
    );
    const parts = [`the plant's switch: ${plant ?? "not read"}`];
    if (now.mode === "shed") parts.push("to go on, turn this switch to monitor and up again");
    else if (!armed) parts.push("not armed: turn this switch to monitor and up again");
    else if (waiting) parts.push("the link asks the plant for control");
    else if (plant !== null && POSITIONS.indexOf(plant) < POSITIONS.indexOf(page)) parts.push("the lower one counts");
    if (!AdaptiveFlotLive.may()) parts.push("this session may only look");
    document.getElementById("switch-note").textContent = parts.join("; ");
  }

  function show(now) {
    grade(now);
    tile("recovery", fixed(now.head.recovery, 1), now.head.recovery === null ? "" : "%", "of the model");
    money(now.head.money);
    decides(now);
    solve(now);
    link(now);
    positions(now);
    document.body.dataset.mode = now.mode;
  }

  return {
    begin: (told) => {
      spec = told;
      drawn = "";
    },
    money,
    show,
  };
})();
