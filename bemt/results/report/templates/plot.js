(function () {
  const all = (s, e) => Array.from((e || document).querySelectorAll(s));

  // Lines of a table of comma-separated values, in which quotes hold text.
  function lines(text) {
    return text.trim().split("\n").map((line) => line.match(/("([^"]|"")*"|[^,]*)(,|$)/g).slice(0, -1).map((cell) =>
      cell.replace(/,$/, "").replace(/^"(.*)"$/, "$1").replace(/""/g, '"'))); // the last match is the end of the line
  }

  // Plots: the nearest point of the visible sources under the pointer; keys switch sources on and off. The numbers
  // are those of the CSV behind the link; data-at says where each of its lines stands: trace x y.
  all("svg[data-at]").forEach((svg) => {
    const figure = svg.closest("figure"), tip = figure.querySelector(".tip"), here = svg.querySelector(".here");
    const at = svg.getAttribute("data-at").split(" ").map((p) => p.split(",").map(Number));
    const [head, ...rows] = lines(decodeURIComponent(figure.querySelector("a.csv").href.replace(/^[^,]*,/, "")));
    const hidden = new Set();
    function leave() { tip.hidden = true; here.style.opacity = 0; }
    function point(event) {
      const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
      const px = (event.clientX - box.left) / box.width * view.width;
      const py = (event.clientY - box.top) / box.height * view.height;
      let best = null, far = 3600;
      at.forEach((p, i) => {
        const d = (p[1] - px) ** 2 + (p[2] - py) ** 2;
        if (!hidden.has(p[0]) && d < far) { best = i; far = d; }
      });
      if (best === null) { leave(); return; }
      const row = rows[best], [, x, y] = at[best];
      tip.textContent = row.map((cell, k) => k === 0 ? cell : cell && head[k] + ": " + cell).filter(Boolean).join("\n");
      tip.hidden = false;
      tip.style.left = 100 * x / view.width + "%";
      tip.style.top = 100 * y / view.height + "%";
      tip.className = "tip" + (x > 0.55 * view.width ? " west" : "") + (y > 0.55 * view.height ? " north" : "");
      here.setAttribute("cx", x);
      here.setAttribute("cy", y);
      here.style.opacity = 1;
    }
    svg.addEventListener("pointermove", point);
    svg.addEventListener("pointerdown", point);
    svg.addEventListener("pointerleave", leave);
    all(".key", figure).forEach((key) => key.addEventListener("click", () => {
      const t = key.getAttribute("data-t"), on = key.getAttribute("aria-pressed") === "true";
      key.setAttribute("aria-pressed", String(!on));
      if (on) { hidden.add(Number(t)); } else { hidden.delete(Number(t)); }
      all("g.trace", svg).filter((g) => g.getAttribute("data-t") === t).forEach((g) => {
        g.style.display = on ? "none" : "";
      });
      leave();
    }));

    // The same numbers as a table, for readers without a pointer.
    const values = figure.querySelector("details.values");
    values.hidden = false;
    values.addEventListener("toggle", () => {
      const place = values.querySelector(".scroll");
      if (!values.open || place.firstChild) { return; }
      const table = place.appendChild(document.createElement("table"));
      [head, ...rows].forEach((row, i) => {
        const tr = (i ? table.tBodies[0] || table.createTBody() : table.createTHead()).insertRow();
        row.forEach((cell) => { tr.appendChild(document.createElement(i ? "td" : "th")).textContent = cell; });
      });
    });
  });
})();
