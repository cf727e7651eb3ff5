"use strict";
(function () {
  const all = (s, e) => Array.from((e || document).querySelectorAll(s));
  const fmt = (v) => v === null || v === undefined ? "-" :
    Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(3) : String(Number(v.toPrecision(4)));

  // Pages: one at a time, chosen by the address; without script, or on paper, all of them.
  const pages = all("section.page");
  document.documentElement.classList.add("js");
  function show() {
    const id = decodeURIComponent(location.hash.slice(1));
    const target = id ? document.getElementById(id) : null;
    const page = (target && target.closest("section.page")) || pages[0];
    pages.forEach((p) => p.classList.toggle("shown", p === page));
    all("nav a").forEach((a) => {
      if (a.getAttribute("href") === "#" + page.id) { a.setAttribute("aria-current", "page"); }
      else { a.removeAttribute("aria-current"); }
    });
    if (target && target !== page) { target.scrollIntoView(); } else { window.scrollTo(0, 0); }
  }
  window.addEventListener("hashchange", show);
  if (pages.length) { show(); }

  // Tables: a click on a heading sorts; numbers by value, the rest by text, gaps last.
  all("table.sort").forEach((table) => {
    all("thead th", table).forEach((th, k) => {
      const button = th.querySelector("button");
      if (!button) { return; }
      button.addEventListener("click", () => {
        const down = th.getAttribute("aria-sort") === "ascending";
        all("thead th", table).forEach((o) => o.removeAttribute("aria-sort"));
        th.setAttribute("aria-sort", down ? "descending" : "ascending");
        const body = table.tBodies[0];
        const value = (tr) => {
          const td = tr.cells[k];
          const v = td.getAttribute("data-v");
          return v === null ? td.textContent.trim() : v === "" ? null : Number(v);
        };
        Array.from(body.rows).map((tr, i) => [value(tr), i, tr]).sort((a, b) => {
          if (a[0] === null || b[0] === null) { return (a[0] === null) - (b[0] === null) || a[1] - b[1]; }
          const mixed = typeof a[0] !== typeof b[0];
          const c = mixed ? (typeof a[0] === "number" ? -1 : 1)
            : typeof a[0] === "number" ? a[0] - b[0] : a[0].localeCompare(b[0], undefined, { numeric: true });
          return (down ? -c : c) || a[1] - b[1];
        }).forEach((row) => body.appendChild(row[2]));
      });
    });
  });

  // Plots: the nearest point of the visible sources under the pointer; keys switch sources on and off.
  all("svg[data-plot]").forEach((svg) => {
    const d = JSON.parse(svg.getAttribute("data-plot"));
    const figure = svg.closest("figure"), tip = figure.querySelector(".tip"), here = svg.querySelector(".here");
    const X = (v) => d.x[2] + ((d.log ? Math.log10(v) : v) - d.x[0]) / (d.x[1] - d.x[0]) * (d.x[3] - d.x[2]);
    const Y = (v) => d.y[2] + (v - d.y[0]) / (d.y[1] - d.y[0]) * (d.y[3] - d.y[2]);
    const hidden = new Set();
    function leave() { tip.hidden = true; here.style.opacity = 0; }
    function point(event) {
      const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
      const px = (event.clientX - box.left) / box.width * view.width;
      const py = (event.clientY - box.top) / box.height * view.height;
      let best = null;
      d.t.forEach((t, i) => {
        if (hidden.has(i)) { return; }
        t.x.forEach((x, j) => {
          if (x === null || t.y[j] === null) { return; }
          const dx = X(x) - px, dy = Y(t.y[j]) - py, far = dx * dx + dy * dy;
          if (!best || far < best.far) { best = { far: far, t: t, j: j, x: X(x), y: Y(t.y[j]) }; }
        });
      });
      if (!best || best.far > 3600) { leave(); return; }
      const t = best.t, j = best.j, u = t.u.length && t.u[j] !== null ? " ± " + fmt(t.u[j]) : "";
      const lines = [t.n];
      if (t.l[j]) { lines.push(t.l[j]); }
      lines.push(d.xl + ": " + fmt(t.x[j]) + (t.h ? u : ""));
      lines.push(d.rows.length ? (d.rows[Math.round(t.y[j])] || "") : d.yl + ": " + fmt(t.y[j]) + (t.h ? "" : u));
      tip.textContent = lines.join("\n");
      tip.hidden = false;
      const left = best.x / view.width, top = best.y / view.height;
      tip.style.left = (100 * left) + "%";
      tip.style.top = (100 * top) + "%";
      tip.className = "tip" + (left > 0.55 ? " west" : "") + (top > 0.55 ? " north" : "");
      here.setAttribute("cx", best.x);
      here.setAttribute("cy", best.y);
      here.style.opacity = 1;
    }
    const save = figure.querySelector("button.csv");
    if (save) {
      save.hidden = false;
      save.addEventListener("click", () => {
        const quote = (s) => '"' + String(s).replace(/"/g, '""') + '"', cell = (v) => v === null || v === undefined ? "" : v;
        const rows = [[quote("source"), quote(d.xl), quote(d.yl), quote("u")].join(",")];
        d.t.forEach((t) => t.x.forEach((x, j) => rows.push([quote(t.n), cell(x), cell(t.y[j]), cell(t.u[j])].join(","))));
        const link = document.createElement("a");
        link.href = "data:text/csv;charset=utf-8," + encodeURIComponent(rows.join("\n") + "\n");
        link.download = save.getAttribute("data-name") + ".csv";
        link.click();
      });
    }
    svg.addEventListener("pointermove", point);
    svg.addEventListener("pointerdown", point);
    svg.addEventListener("pointerleave", leave);
    all(".key", figure).forEach((key) => key.addEventListener("click", () => {
      const i = Number(key.getAttribute("data-t")), on = key.getAttribute("aria-pressed") === "true";
      key.setAttribute("aria-pressed", String(!on));
      if (on) { hidden.add(i); } else { hidden.delete(i); }
      all("g.trace", svg).filter((g) => g.getAttribute("data-t") === String(i)).forEach((g) => {
        g.style.display = on ? "none" : "";
      });
      leave();
    }));
  });
})();
