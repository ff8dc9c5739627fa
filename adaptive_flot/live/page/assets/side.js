/* Alarms, the card of discovery, shadows, and what persons did. */
const AdaptiveFlotSide = (() => {
  "use strict";
  const { element, number, clock } = AdaptiveFlotText;
  let drawn = {};

  /* Fill a part of the page anew where it has changed: a button keeps its place under a pointer. */
  function fill(id, content, make) {
    const key = JSON.stringify([content, AdaptiveFlotLive.may()]);
    if (drawn[id] === key) return;
    drawn[id] = key;
    document.querySelector(`#${id} .inside`).replaceChildren(...make(content));
  }

  const amount = (value, unit) => `${number(value)}${unit === "–" ? "" : unit.startsWith("10") ? ` × ${unit}` : ` ${unit}`}`;

  function alarms(list) {
    document.getElementById("alarms").classList.toggle("bad", list.some((a) => a.active && !a.by));
    if (!list.length) return [element("p", "soft", "No alarm.")];
    const rows = [...list].sort((a, b) => Number(b.active) - Number(a.active) || Number(!b.by) - Number(!a.by) || (b.since ?? 0) - (a.since ?? 0)).map((alarm) => {
      const row = element("div", `alarm ${alarm.active ? "active" : "gone"} ${alarm.by ? "known" : "new"}`);
      row.dataset.key = alarm.key;
      const words = element("div", "words", alarm.words);
      const parts = [alarm.active ? "" : "over", alarm.since === null ? "" : `since ${clock(alarm.since)}`, alarm.by ? `seen by ${alarm.by}` : ""];
      words.append(element("span", "soft", parts.filter(Boolean).join("; ")));
      row.append(words);
      if (!alarm.by) row.append(AdaptiveFlotLive.button("Acknowledge", () => AdaptiveFlotLive.ask("acknowledge", alarm.key)));
      return row;
    });
    if (list.filter((a) => !a.by).length > 1) rows.push(AdaptiveFlotLive.button("Acknowledge all", () => AdaptiveFlotLive.ask("acknowledge", "all")));
    return rows;
  }

  function errors(list, before, after) {
    if (!list.length) return [];
    const table = element("table", "errors");
    const head = table.createTHead().insertRow();
    for (const words of ["", before, after]) head.append(element("th", "", words));
    const body = table.createTBody();
    for (const e of list) {
      const row = body.insertRow();
      row.append(element("th", "", e.name));
      const better = e.after !== null && e.before !== null && e.after < e.before;
      row.append(element("td", "", amount(e.before, e.unit)), element("td", better ? "good" : "", amount(e.after, e.unit)));
    }
    return [table];
  }

  function card({ found, words, reverts, effects }) {
    const said = words && !(found && words.startsWith("search ended")) ? [element("p", "soft said", `Last: ${words}`)] : [];
    const revert = () => AdaptiveFlotLive.button("Revert", () => AdaptiveFlotLive.ask("revert"), { sure: true, off: !reverts });
    const more = reverts ? [element("p", "in-use", `The model in use is extended: ${effects.join(", ")}.`)] : [];
    if (!found) return [...(reverts ? [...more, revert()] : [element("p", "soft", "Nothing was found that the model lacks.")]), ...said];
    const parts = [...more, element("p", "stage", `${found.stage}${found.by ? ` by ${found.by}` : ""}`)];
    parts.push(element("p", "reason", `${found.since === null ? "" : `At ${clock(found.since)}: `}${found.reason}`));
    if (found.evidence.length) {
      const evidence = document.createElement("details");
      evidence.append(element("summary", "", "Evidence"));
      const list = element("ul", "");
      for (const words of found.evidence) list.append(element("li", "", words));
      evidence.append(list);
      parts.push(evidence);
    }
    if (found.errors.length) parts.push(element("p", "soft", "Error on rows that chose nothing:"), ...errors(found.errors, "as it is", "extended"));
    if (found.tried.length) parts.push(element("p", "soft", "One-step error in shadow, before it was applied:"), ...errors(found.tried, "acting", "extended"));
    const row = element("div", "actions");
    const { button, ask } = AdaptiveFlotLive;
    const can = found.can;
    row.append(button("Acknowledge", () => ask("acknowledge", "discovery"), { off: !can }));
    row.append(button("Try in shadow", () => ask("shadow"), { off: !found.tries }));
    row.append(button("Apply", () => ask("apply"), { sure: true, off: found.stage !== "in shadow" }));
    row.append(revert());
    parts.push(row, ...said);
    return parts;
  }

  function shadows(list) {
    if (!list.length) return [element("p", "soft", "Nothing runs in shadow.")];
    return list.map((shadow) => {
      const box = element("div", `shadow ${shadow.runs ? "" : "ended"}`);
      box.dataset.role = shadow.role;
      box.append(element("h3", "", shadow.role), element("p", "soft", shadow.who));
      const late = shadow.left_out ? `; ${shadow.left_out} samples left out` : "";
      box.append(element("p", shadow.runs ? "" : "bad", `${shadow.status}${late}; ${shadow.rows} rows`));
      box.append(...errors(shadow.errors, "acting", "shadow"));
      if (shadow.wants.length) box.append(element("p", "soft", `would set ${shadow.wants.map((w) => `${w.name.toLowerCase()} ${amount(w.value, w.unit)}`).join(", ")}`));
      return box;
    });
  }

  function tags(now) {
    const rows = [["solver", now.solver.state, null], ...now.tags.map((t) => [t.name, t.state, t.age])];
    return rows.map(([name, state, age]) => {
      const row = element("div", "state");
      row.dataset.name = name;
      const fine = ["ok", "no new value", "no decision", "not read"].includes(state);
      row.append(element("span", "", name), element(state === "ok" || !fine ? "b" : "span", fine ? "" : "bad", state), element("span", "soft", age === null ? "" : `${Math.round(age)} s old`));
      return row;
    });
  }

  function answers(list) {
    if (!list.length) return [element("p", "soft", "Nothing yet in this session.")];
    return [...list].reverse().slice(0, 8).map((a) => {
      const row = element("p", "answer", `${a.at ? `${clock(Date.parse(a.at) / 1000)} ` : ""}${a.person}: ${a.action}`);
      row.append(element("span", "soft", `${a.answer}`));
      return row;
    });
  }

  function show(now) {
    fill("alarms", now.alarms, alarms);
    fill("found", { found: now.card, words: now.discovery, reverts: now.reverts, effects: now.effects }, card);
    fill("shadows", now.shadows, shadows);
    fill("strips", { tags: now.tags, solver: { state: now.solver.state } }, tags);
    fill("answers", now.answers, answers);
  }

  return { begin: () => (drawn = {}), show };
})();
