/* Numbers as charts hold them and as a reader sees them; elements of the page. Nothing here is ever read as HTML. */
const AdaptiveFlotText = (() => {
  "use strict";

  function element(tag, className, text = "") {
    const made = document.createElement(tag);
    made.className = className;
    made.textContent = text;
    return made;
  }

  function decode(c) {
    const { o, s } = c;
    if (c.v === undefined) return Array.from({ length: c.n }, (_, k) => o + s * k);
    return c.v.map((k) => (k === null ? null : o + s * k));
  }

  function number(value, span = 0) {
    if (value === null || value === undefined || !Number.isFinite(value)) return "–";
    const digits = span > 0 ? decimals(span) : null;
    const text = digits === null ? String(Number(value.toPrecision(5))) : value.toFixed(digits);
    return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
  }

  /* Decimals in which steps of a size can be told, as 0.25 needs two. */
  function decimals(step) {
    let digits = 0;
    while (digits < 8 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6 * 10 ** digits * step) digits++;
    return digits;
  }

  /* Time of day of seconds since 1970; without seconds where steps are whole minutes. */
  function clock(seconds, step = 1) {
    if (!Number.isFinite(seconds)) return "–";
    return new Date(seconds * 1000).toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit", ...(step % 60 ? { second: "2-digit" } : {}) });
  }

  function moment(x, value) {
    if (x.clock) return clock(value);
    const own = number(Number((value / x.seconds).toPrecision(6)));
    return `${x.label} ${own}${x.unit === "–" ? "" : " " + x.unit}`;
  }

  return { element, decode, number, moment, clock };
})();
