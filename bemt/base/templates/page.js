"use strict";
(function () {
  const all = (s, e) => Array.from((e || document).querySelectorAll(s));

  // Pages: one at a time, chosen by the address; without script, or on paper, all of them.
  const pages = all("section.page");
  document.documentElement.classList.add("js");
  function show() {
    const id = decodeURIComponent(location.hash.slice(1));
    const target = id ? document.getElementById(id) : null;
    const page = (target && target.closest("section.page")) || pages[0];
    pages.forEach((p) => p.classList.toggle("shown", p === page));
    all("nav a").forEach((a) => {
      if (a.getAttribute("href") === "#" + page.id) {
        a.setAttribute("aria-current", "page");
        a.scrollIntoView({ block: "nearest", inline: "center" });
      } else { a.removeAttribute("aria-current"); }
    });
    if (target && target !== page) { target.scrollIntoView(); } else { window.scrollTo(0, 0); }
    page.dispatchEvent(new Event("shown"));
  }
  if (pages.length) {
    window.addEventListener("hashchange", show);
    window.addEventListener("DOMContentLoaded", show);
  }

  // Tables: a click on a heading sorts; numbers by value, the rest by text, gaps last.
  all("table.sort").forEach((table) => all("thead th", table).forEach((th, k) => {
    th.querySelector("button").addEventListener("click", () => {
      const down = th.getAttribute("aria-sort") === "ascending";
      all("thead th", table).forEach((o) => o.removeAttribute("aria-sort"));
      th.setAttribute("aria-sort", down ? "descending" : "ascending");
      const body = table.tBodies[0];
      const value = (tr) => {
        const td = tr.cells[k], v = td.getAttribute("data-v");
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
  }));
})();
