// Zooms the figures of a report: wheel (with Ctrl, or once a figure has the focus), drag, double
// click, keys, buttons. Only what a figure shows of itself is changed, its viewBox. Where the
// pointer is, in the figure's axes, stands in its corner: zoomed, their labels may be out of sight.
"use strict";
(() => {
  const MOST = 40;  // a figure holds a few points per pixel column: beyond, nothing new appears
  const KEYS = {
    "+": ["zoom", 0.5], "=": ["zoom", 0.5], "-": ["zoom", 2], "0": ["whole"], Escape: ["whole"],
    ArrowLeft: ["pan", -0.2, 0], ArrowRight: ["pan", 0.2, 0], ArrowUp: ["pan", 0, -0.2],
    ArrowDown: ["pan", 0, 0.2],
  };
  const HINT = "Zoom: drag a range or turn the wheel, double click for the whole; keys + − 0 and arrows";

  const element = (tag, name, text) => {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text) made.textContent = text;
    return made;
  };

  function zoomable(svg) {
    const given = svg.viewBox.baseVal, full = [given.x, given.y, given.width, given.height];
    let view = full.slice(), start = null;
    const place = element("div", "zoom"), tools = element("div", "zoom-tools");
    const mark = element("div", "zoom-mark"), here = element("div", "zoom-here");
    const axes = JSON.parse(svg.dataset.axes || "[]");

    const show = (x, y, w) => {
      w = Math.min(full[2], Math.max(full[2] / MOST, w));
      const h = w * full[3] / full[2];
      x = Math.min(full[0] + full[2] - w, Math.max(full[0], x));
      y = Math.min(full[1] + full[3] - h, Math.max(full[1], y));
      view = [x, y, w, h];
      svg.setAttribute("viewBox", view.join(" "));
      place.classList.toggle("zoomed", w < full[2]);
    };
    const at = (event) => {  // place of a pointer in the figure's own units
      const point = new DOMPoint(event.clientX, event.clientY);
      return point.matrixTransform(svg.getScreenCTM().inverse());
    };
    const value = ([low, high, isLog], share) => {
      const number = isLog ? low * (high / low) ** share : low + share * (high - low);
      const digits = isLog ? 4 : Math.ceil(Math.log10(1e4 * Math.max(Math.abs(number), 1e-4 *
        Math.abs(high - low)) / Math.abs(high - low)));
      return Number(number.toPrecision(Math.min(9, Math.max(2, digits)))).toString();
    };
    const read = (event) => {
      const point = at(event);
      const x = (point.x - full[0]) / full[2], y = 1 - (point.y - full[1]) / full[3];
      const inside = axes.find((a) => x >= a.box[0] && x <= a.box[2] && y >= a.box[1] && y <= a.box[3]);
      here.textContent = !inside ? "" : "x " +
        value(inside.x, (x - inside.box[0]) / (inside.box[2] - inside.box[0])) + ", y " +
        value(inside.y, (y - inside.box[1]) / (inside.box[3] - inside.box[1]));
    };
    const act = {
      zoom: (factor, at) => {
        const x = at ? at.x : view[0] + view[2] / 2, y = at ? at.y : view[1] + view[3] / 2;
        const w = Math.min(full[2], Math.max(full[2] / MOST, factor * view[2])), f = w / view[2];
        show(x - f * (x - view[0]), y - f * (y - view[1]), w);
      },
      pan: (dx, dy) => show(view[0] + dx * view[2], view[1] + dy * view[3], view[2]),
      whole: () => show(full[0], full[1], full[2]),
    };

    svg.replaceWith(place);
    place.append(svg, mark, here, tools);
    place.tabIndex = 0;
    place.setAttribute("role", "group");
    place.setAttribute("aria-label", HINT);
    for (const [text, label, ...action] of [
      ["+", "Zoom in", "zoom", 0.5], ["−", "Zoom out", "zoom", 2], ["⤢", "Whole figure", "whole"],
    ]) {
      const button = element("button", "", text);
      button.type = "button";
      button.title = button.ariaLabel = label;
      button.addEventListener("click", () => act[action[0]](action[1]));
      tools.append(button);
    }

    place.addEventListener("keydown", (event) => {
      const action = KEYS[event.key];
      const idle = event.key.startsWith("Arrow") && view[2] >= full[2];  // then the page scrolls
      if (!action || idle || event.ctrlKey || event.metaKey || event.altKey) return;
      act[action[0]](action[1], action[2]);
      event.preventDefault();
    });
    place.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== place) return;  // the page scrolls
      act.zoom(Math.exp(0.002 * Math.max(-300, Math.min(300, event.deltaY))), at(event));
      event.preventDefault();
    }, { passive: false });
    place.addEventListener("dblclick", (event) => {
      if (tools.contains(event.target)) return;
      if (view[2] < full[2]) act.whole(); else act.zoom(0.4, at(event));
    });

    // A drag marks what is wanted, or moves a figure of which a part is shown. Touch scrolls.
    svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      start = { x: event.clientX, y: event.clientY, at: at(event), pans: view[2] < full[2] };
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", (event) => {
      read(event);
      if (!start) return;
      if (start.pans) {
        const now = at(event);
        show(view[0] + start.at.x - now.x, view[1] + start.at.y - now.y, view[2]);
        return;
      }
      const box = place.getBoundingClientRect();
      mark.style.left = `${Math.min(start.x, event.clientX) - box.left}px`;
      mark.style.top = `${Math.min(start.y, event.clientY) - box.top}px`;
      mark.style.width = `${Math.abs(event.clientX - start.x)}px`;
      mark.style.height = `${Math.abs(event.clientY - start.y)}px`;
      mark.classList.add("shown");
    });
    const end = (event) => {
      if (start && !start.pans && event.type === "pointerup") {
        const now = at(event), w = Math.abs(now.x - start.at.x), h = Math.abs(now.y - start.at.y);
        if (Math.hypot(event.clientX - start.x, event.clientY - start.y) > 8) {
          const wide = Math.max(w, h * full[2] / full[3]);  // the figure keeps its proportions
          const high = wide * full[3] / full[2];
          show((now.x + start.at.x - wide) / 2, (now.y + start.at.y - high) / 2, wide);
        }
      }
      start = null;
      mark.classList.remove("shown");
    };
    svg.addEventListener("pointerup", end);
    svg.addEventListener("pointercancel", end);
    svg.addEventListener("pointerleave", () => { here.textContent = ""; });
    addEventListener("beforeprint", act.whole);
  }

  document.querySelectorAll("figure > svg[viewBox]").forEach(zoomable);
})();
