/* The stream, who is logged in, requests. What the server tells is only ever shown as text. */
const AdaptiveFlotLive = (() => {
  "use strict";
  const LEAST_SILENCE_MS = 3000; // without a cycle for so long, and three intervals, contact counts as lost
  const byId = (id) => document.getElementById(id);
  let who = { name: "", may: "view", csrf: "" };
  let spec = null;
  let heard = performance.now();
  let stream = null;
  let toastEnds = 0;

  async function ask(action, about = "") {
    try {
      const answer = await fetch("/action", {
        method: "POST",
        headers: { "content-type": "application/json", "x-csrf-token": who.csrf },
        body: JSON.stringify({ action, about }),
      });
      toast(await answer.text(), !answer.ok);
    } catch {
      toast("No contact with the link: nothing was asked for.", true);
    }
  }

  function toast(words, bad) {
    const box = byId("toast");
    box.textContent = words.slice(0, 300);
    box.classList.toggle("bad", bad);
    box.hidden = false;
    clearTimeout(toastEnds);
    toastEnds = setTimeout(() => (box.hidden = true), 6000);
  }

  /* A button of an action. One that needs a second click says so, and forgets the first after some seconds. */
  function button(words, act, { sure = false, off = false } = {}) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = words;
    made.disabled = off || who.may !== "act";
    if (who.may !== "act") made.title = "Log in with the token for acting";
    let first = -Infinity;
    made.addEventListener("click", () => {
      if (sure && performance.now() - first > 5000) {
        first = performance.now();
        made.textContent = `Sure? ${words}`;
        made.classList.add("sure");
        setTimeout(() => {
          made.textContent = words;
          made.classList.remove("sure");
        }, 5000);
        return;
      }
      act();
    });
    return made;
  }

  function begin(told) {
    spec = told.spec;
    who = told.who;
    document.title = `${spec.title} – live link`;
    byId("title").textContent = spec.title;
    byId("who").textContent = who.may === "act" ? `${who.name} may act` : `${who.name || "Somebody"} may look`;
    document.body.classList.remove("waiting");
    AdaptiveFlotHead.begin(spec);
    AdaptiveFlotSide.begin(spec);
    AdaptiveFlotOverTime.begin(spec, told.rows);
    if (told.now) show(told.now, null);
  }

  function show(now, row) {
    heard = performance.now();
    if (now.time !== null) byId("clock").dataset.time = now.time;
    byId("clock").textContent = now.time === null ? "The plant has told nothing yet" : `Plant's clock ${AdaptiveFlotText.clock(now.time)}`;
    AdaptiveFlotHead.show(now);
    AdaptiveFlotSide.show(now);
    AdaptiveFlotOverTime.show(now, row);
    lost();
  }

  function lost() {
    const quiet = performance.now() - heard;
    const is = quiet > Math.max(LEAST_SILENCE_MS, spec ? 3000 * spec.interval : 0);
    byId("lost").hidden = !is;
    document.body.classList.toggle("stale", is);
    if (is) byId("lost").textContent = `No contact with the link for ${Math.round(quiet / 1000)} s. What is shown is old.`;
  }

  async function reconnect() {
    try {
      const answer = await fetch("/", { redirect: "manual" });
      if (answer.type === "opaqueredirect") return location.assign("/login");
    } catch {
      /* the link is away: try again */
    }
    setTimeout(listen, 2000);
  }

  function listen() {
    stream?.close();
    stream = new EventSource("/events");
    stream.addEventListener("begin", (event) => begin(JSON.parse(event.data)));
    stream.addEventListener("cycle", (event) => {
      if (!spec) return;
      const told = JSON.parse(event.data);
      show(told.now, told.row);
    });
    stream.addEventListener("error", () => stream.readyState === EventSource.CLOSED && reconnect());
  }

  function theme() {
    const root = document.documentElement;
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    AdaptiveFlotChart.recolour();
  }

  async function out() {
    await fetch("/logout", { method: "POST", headers: { "x-csrf-token": who.csrf } });
    location.assign("/login");
  }

  const may = () => who.may === "act";
  document.addEventListener("DOMContentLoaded", () => {
    byId("theme").addEventListener("click", theme);
    byId("out").addEventListener("click", out);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => AdaptiveFlotChart.recolour());
    setInterval(lost, 500);
    listen();
  });
  return { ask, button, may, byId };
})();
