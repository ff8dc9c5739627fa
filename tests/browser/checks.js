// What is wrong with the page that is open: text that is cut off or overlaps, a page wider than the window.
// `watch` is run before the scripts of the page; it writes down the text that they draw on canvases.
(() => {
  const drawn = new Map(); // canvas -> [text, left, top, right, bottom] since it was cleared last
  const proto = CanvasRenderingContext2D.prototype;
  const { clearRect, fillText } = proto;
  proto.clearRect = function (x, y, w, h) {
    if (x <= 0 && y <= 0 && w >= this.canvas.width && h >= this.canvas.height) drawn.set(this.canvas, []);
    return clearRect.apply(this, arguments);
  };
  proto.fillText = function (text, x, y) {
    const m = this.measureText(text);
    const at = this.getTransform().transformPoint({ x, y });
    const box = [at.x - m.actualBoundingBoxLeft, at.y - m.actualBoundingBoxAscent, at.x + m.actualBoundingBoxRight, at.y + m.actualBoundingBoxDescent];
    if (!drawn.has(this.canvas)) drawn.set(this.canvas, []);
    if (text.trim()) drawn.get(this.canvas).push([text, ...box]);
    return fillText.apply(this, arguments);
  };

  const near = 1.5; // px that antialiasing may take

  function canvasProblems() {
    const found = [];
    for (const [canvas, texts] of drawn) {
      if (!canvas.isConnected) continue;
      for (const [text, l, t, r, b] of texts) {
        if (l < -near || t < -near || r > canvas.width + near || b > canvas.height + near) found.push(`chart: ${text} is cut off at the edge`);
      }
      texts.forEach(([one, l, t, r, b], i) => {
        for (const [other, L, T, R, B] of texts.slice(i + 1)) {
          if (l < R - near && L < r - near && t < B - near && T < b - near) found.push(`chart: ${one} and ${other} overlap`);
        }
      });
      const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
      if (!data.some((v, i) => i % 4 === 3 && v > 0)) found.push("chart: nothing is drawn");
    }
    return found;
  }

  function textProblems() {
    const found = [];
    const wide = document.documentElement.clientWidth;
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    const range = document.createRange();
    while (walker.nextNode()) {
      const node = walker.currentNode;
      const parent = node.parentElement;
      if (!node.data.trim() || parent.closest("script, style, noscript") || !parent.checkVisibility({ visibilityProperty: true })) continue;
      range.selectNodeContents(node);
      for (const box of range.getClientRects()) {
        let cut = null;
        let scrolls = false;
        for (let at = parent; at && at !== document.documentElement; at = at.parentElement) {
          const style = getComputedStyle(at);
          if (["auto", "scroll"].includes(style.overflowX)) scrolls = true;
          const hides = ["hidden", "clip"].includes(style.overflowX) || ["hidden", "clip"].includes(style.overflowY);
          const own = at.getBoundingClientRect();
          if (hides && !scrolls && (box.right > own.right + near || box.left < own.left - near || box.bottom > own.bottom + near)) cut = "its box";
        }
        if (!scrolls && (box.right > wide + near || box.left < -near)) cut = "the window";
        if (cut) found.push(`text: "${node.data.trim().slice(0, 40)}" is cut off by ${cut}`);
      }
    }
    return found;
  }

  window.pageProblems = () => {
    const over = document.documentElement.scrollWidth - document.documentElement.clientWidth;
    return [...(over > 1 ? [`page: ${over} px wider than the window`] : []), ...textProblems(), ...canvasProblems()];
  };
})();
