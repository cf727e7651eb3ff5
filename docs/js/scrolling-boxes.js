// A box that scrolls can be reached by keyboard. The theme wraps tables after this runs, hence the second look.
const reach = () => document
  .querySelectorAll(".md-typeset pre > code, .md-typeset pre, .md-typeset .output, .md-typeset__scrollwrap")
  .forEach(box => { if (box.scrollWidth > box.clientWidth) box.tabIndex = 0; });
new ResizeObserver(reach).observe(document.body);
new MutationObserver(reach).observe(document.body, {childList: true, subtree: true});
