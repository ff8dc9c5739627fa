/* The page around the charts: light and dark, list of contents, folded chapters, sorted tables, print. */
(() => {
  "use strict";
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const theme = document.getElementById("theme");
  const folds = [...document.querySelectorAll("details.fold")];

  function kept(value) {
    try {
      if (value !== undefined) localStorage.setItem("adaptive-flot-theme", value);
      return localStorage.getItem("adaptive-flot-theme");
    } catch {
      return null; // a browser may keep nothing of a file
    }
  }

  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches);
  function shown() {
    theme.textContent = isDark() ? "Light" : "Dark";
    theme.title = `Show the page ${isDark() ? "light" : "dark"}`;
    AdaptiveFlotChart.recolour();
  }

  function startThemes() {
    const before = kept();
    if (before === "dark" || before === "light") root.dataset.theme = before;
    theme.hidden = false;
    theme.addEventListener("click", () => {
      const wanted = isDark() ? "light" : "dark";
      if ((wanted === "dark") === dark.matches) delete root.dataset.theme;
      else root.dataset.theme = wanted;
      kept(root.dataset.theme ?? "");
      shown();
    });
    dark.addEventListener("change", shown);
    shown();
  }

  function startContents() {
    const toc = document.getElementById("toc");
    const wide = matchMedia("(min-width: 76rem)");
    const fit = () => (toc.open = wide.matches);
    wide.addEventListener("change", fit);
    fit();
    const open = () => {
      const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
      if (!target) return;
      for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
      target.scrollIntoView();
    };
    addEventListener("hashchange", open);
    toc.addEventListener("click", (event) => {
      const link = event.target.closest("a");
      if (!link) return;
      if (!wide.matches) toc.open = false;
      if (link.hash === location.hash) open();
    });
    open();
    /* Chapters of one name close each other: the one that opens stays in sight, though what is above it has shrunk. */
    for (const fold of folds) {
      fold.addEventListener("toggle", () => {
        const { top } = fold.getBoundingClientRect();
        if (fold.open && (top < 0 || top > innerHeight)) fold.scrollIntoView();
      });
    }
    const links = [...toc.querySelectorAll("a")];
    const mark = new IntersectionObserver((seen) => {
      for (const one of seen) if (one.isIntersecting) links.forEach((link) => link.classList.toggle("here", link.hash === `#${one.target.id}`));
    }, { rootMargin: "-10% 0px -80% 0px" });
    document.querySelectorAll("#answer, details.fold, #made").forEach((part) => mark.observe(part));
  }

  /* A cell as what it sorts by: its first number, or its words; a dash comes last. */
  function key(cell) {
    const text = cell.textContent.replace("★", "").trim();
    if (text === "" || text === "–") return null;
    const plain = text.replace(/[\u00a0\u202f ](?=\d{3}\b)/g, "").replace("−", "-").replace(/^[=<>±] */, "");
    const found = plain.match(/^[+-]?\d+(\.\d+)?(e[+-]?\d+)?/i);
    return found ? Number(found[0]) : text;
  }

  function order(a, b, sign) {
    if (a === null || b === null) return (a === null) - (b === null);
    const numbers = typeof a === "number" && typeof b === "number";
    return sign * (numbers ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));
  }

  function startTables() {
    for (const table of document.querySelectorAll("table")) {
      const headings = [...table.tHead.rows[0].cells];
      const body = table.tBodies[0];
      if (body.rows.length < 2) continue;
      headings.forEach((heading, column) => {
        heading.classList.add("sorts");
        heading.tabIndex = 0;
        const sort = () => {
          const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
          headings.forEach((other) => other.removeAttribute("aria-sort"));
          heading.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
          const rows = [...body.rows].map((row) => [key(row.cells[column]), row]);
          body.append(...rows.sort((a, b) => order(a[0], b[0], sign)).map(([, row]) => row));
        };
        heading.addEventListener("click", sort);
        heading.addEventListener("keydown", (event) => event.key === "Enter" && sort());
      });
    }
  }

  /* The cell of a map under the pointer: its words below the map, its row and column marked. */
  function startMaps() {
    for (const table of document.querySelectorAll("table.heat")) {
      const told = table.closest("figure").querySelector(".told");
      told.hidden = false;
      const mark = (cell) => {
        table.querySelectorAll(".at").forEach((one) => one.classList.remove("at"));
        if (!cell?.title && !cell?.dataset.words) return;
        if (cell.title) [cell.dataset.words, cell.title] = [cell.title, ""]; // told here, and not by the browser too
        told.textContent = cell.dataset.words;
        [cell, cell.parentElement.cells[0], table.tHead.rows[0].cells[cell.cellIndex]].forEach((one) => one.classList.add("at"));
      };
      table.addEventListener("pointerover", (event) => mark(event.target.closest("td")));
      table.addEventListener("pointerdown", (event) => mark(event.target.closest("td")));
      table.addEventListener("pointerleave", () => mark(null));
    }
  }

  /* Paper is white, shows all chapters, and is as wide as paper. */
  function startPrint() {
    let closed = [];
    let before = "";
    addEventListener("beforeprint", () => {
      closed = folds.filter((fold) => !fold.open);
      folds.forEach((fold) => ([fold.dataset.name, fold.name] = [fold.name, ""]));
      closed.forEach((fold) => (fold.open = true));
      before = root.dataset.theme ?? "";
      root.dataset.theme = "light";
      AdaptiveFlotChart.all();
      AdaptiveFlotChart.recolour();
      AdaptiveFlotChart.charts.forEach((chart) => chart.resize(Math.min(chart.width(), 680)));
    });
    addEventListener("afterprint", () => {
      closed.forEach((fold) => (fold.open = false));
      folds.forEach((fold) => (fold.name = fold.dataset.name));
      if (before) root.dataset.theme = before;
      else delete root.dataset.theme;
      AdaptiveFlotChart.recolour();
      AdaptiveFlotChart.charts.forEach((chart) => chart.resize());
    });
  }

  document.querySelectorAll(".hint").forEach((hint) => (hint.hidden = false));
  startThemes();
  startContents();
  startTables();
  startMaps();
  startPrint();
  AdaptiveFlotChart.start();
})();
