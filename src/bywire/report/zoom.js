// Zooms into the figures of a report by wheel (with Ctrl, or if a figure has the focus), drag, double
// click, keys and buttons. A drag in a time panel zooms into that time range in all time panels;
// all other actions change the figure's viewBox. The corner of a figure shows the pointer's position
// in its axes, because their labels may be out of sight after a zoom.
"use strict";
(() => {
  const MOST = 40;  // a figure has a few points per pixel column: beyond, nothing new appears
  const KEYS = {
    "+": ["zoom", 0.5], "=": ["zoom", 0.5], "-": ["zoom", 2], "0": ["whole"], Escape: ["whole"],
    ArrowLeft: ["pan", -0.2, 0], ArrowRight: ["pan", 0.2, 0], ArrowUp: ["pan", 0, -0.2],
    ArrowDown: ["pan", 0, 0.2],
  };
  const HINT = "Zoom: drag over a range (in a time panel, this zooms all time panels) or turn " +
    "the wheel. Double-click to reset. Keys: + − 0 and arrows";
  const LEAST = 8;  // px of an intended drag
  const timePanels = [];  // of all figures of the page

  const element = (tag, name, text) => {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text) made.textContent = text;
    return made;
  };
  const group = (svg) => document.createElementNS(svg.namespaceURI, "g");
  const toggled = (tag, isShown) => { if (tag) tag.style.display = isShown ? "" : "none"; };

  // Round values between two, about `count` of them, with their texts.
  function ticksBetween(low, high, count) {
    const decade = 10 ** Math.floor(Math.log10((high - low) / count));
    const factor = [1, 2, 2.5, 5, 10].find((each) => each * decade * count >= high - low);
    const step = factor * decade, digits = Math.round(-Math.log10(decade)) + (factor === 2.5) - (factor === 10);
    const made = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
      made.push([k * step, (k * step).toFixed(Math.max(0, digits)).replace("-", "−")]);
    return made;
  }

  // Make a panel over time stretch: what its clip path holds, and its ticks again. Null for pixels.
  function stretchable(svg, axes, [x0, y0, w, h]) {
    const left = x0 + axes.box[0] * w, right = x0 + axes.box[2] * w, bottom = y0 + (1 - axes.box[1]) * h;
    const isOurs = ({ firstElementChild: { x, y, height } }) => Math.abs(x.baseVal.value - left) < 1
      && Math.abs(y.baseVal.value + height.baseVal.value - bottom) < 1;
    const clip = [...svg.querySelectorAll("clipPath")].find(isOurs);
    if (!clip) return null;
    const isHeld = (each) => each.getAttribute("clip-path").endsWith(`#${clip.id})`);
    const [low, high] = axes.x, held = [...svg.querySelectorAll("[clip-path]")].filter(isHeld);
    const ticks = held.flatMap((grid) => {  // matplotlib draws a tick as line, mark and text
      const next = grid.nextElementSibling, mark = next?.localName === "defs" ? next.nextElementSibling : next;
      const use = mark?.querySelector("use"), text = mark?.nextElementSibling;
      const isTick = /^M (\S+) \S+\s+L \1 /.test(grid.getAttribute("d")) && use
        && Math.abs(use.y.baseVal.value - bottom) < 1 && !mark.hasAttribute("clip-path");
      return isTick ? [{ grid, mark, use, text: text?.localName === "text" ? text : null }] : [];
    });
    const lines = new Set(ticks.map(({ grid }) => grid)), markers = [];
    const inner = held.filter((each) => !lines.has(each)).map((each) => {
      const clipped = group(svg), moved = group(svg);
      clipped.setAttribute("clip-path", each.getAttribute("clip-path"));
      each.removeAttribute("clip-path");
      each.replaceWith(clipped);
      clipped.append(moved);
      moved.append(each);
      for (const use of each.querySelectorAll("use")) if (use.x.baseVal.value >= left) markers.push(use);
      return moved;
    });
    let made = [];
    const panel = { axes, left, right, t: axes.t };
    panel.show = (from, to) => {  // in the panel's unit
      const isWhole = !(to > low && from < high);
      [from, to] = isWhole ? [low, high] : [Math.max(low, from), Math.min(high, to)];
      from = Math.min(from, Math.max(low, high - (high - low) / MOST));
      to = Math.max(to, from + (high - low) / MOST);
      const factor = (high - low) / (to - from), place = (value) => left + (right - left) * (value - from) / (to - from);
      panel.isWhole = factor <= 1;
      axes.x = [from, to, false];
      const stretch = (each, by, shift) => (panel.isWhole ? each.removeAttribute("transform")
        : each.setAttribute("transform", `matrix(${by} 0 0 1 ${shift} 0)`));
      for (const each of inner) stretch(each, factor, place(low) - factor * left);
      for (const use of markers) stretch(use, 1 / factor, use.x.baseVal.value * (1 - 1 / factor));
      for (const { grid, mark, text } of ticks) [grid, mark, text].forEach((each) => toggled(each, panel.isWhole));
      made.forEach((each) => each.remove());
      made = panel.isWhole || !ticks.length ? [] : ticksBetween(from, to, Math.max(3, ticks.length - 1)).flatMap(([value, said]) => {
        const { grid, mark, text } = ticks[0], x = place(value);
        const copies = [grid, mark, ticks.find((each) => each.text)?.text].map((each) => each?.cloneNode(true));
        copies[0].setAttribute("d", grid.getAttribute("d").replaceAll(/([ML]) \S+/g, `$1 ${x}`));
        copies[1].querySelector("use").setAttribute("x", x);
        if (copies[2]) {
          copies[2].removeAttribute("textLength");
          copies[2].setAttribute("x", x);
          copies[2].style.textAnchor = "middle";
          copies[2].textContent = said;
        }
        const shown = copies.filter(Boolean);
        grid.before(copies[0]);
        mark.after(...shown.slice(1));
        shown.forEach((each) => toggled(each, true));
        return shown;
      });
    };
    panel.isWhole = true;
    timePanels.push(panel);
    return panel;
  }
  const showTime = (from, to) => timePanels.forEach((each) => each.show(from / each.t, to / each.t));  // [s]
  const showAllTime = () => showTime(NaN, NaN);

  function zoomable(svg) {
    const given = svg.viewBox.baseVal, full = [given.x, given.y, given.width, given.height];
    let view = full.slice(), start = null;
    const place = element("div", "zoom"), tools = element("div", "zoom-tools");
    const mark = element("div", "zoom-mark"), here = element("div", "zoom-here");
    const axes = JSON.parse(svg.dataset.axes || "[]");
    const panels = axes.filter(({ t }) => t).map((each) => stretchable(svg, each, full)).filter(Boolean);
    const isTimed = () => panels.some(({ isWhole }) => !isWhole);

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
    const axesAt = (point) => {
      const x = (point.x - full[0]) / full[2], y = 1 - (point.y - full[1]) / full[3];
      return [axes.find((a) => x >= a.box[0] && x <= a.box[2] && y >= a.box[1] && y <= a.box[3]), x, y];
    };
    const read = (event) => {
      const [inside, x, y] = axesAt(at(event));
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
      pan: (dx, dy) => {
        if (view[2] < full[2]) return show(view[0] + dx * view[2], view[1] + dy * view[3], view[2]);
        const panel = panels.find(({ isWhole }) => !isWhole), [from, to] = panel.axes.x, by = dx * (to - from);
        showTime((from + by) * panel.t, (to + by) * panel.t);
      },
      whole: () => {
        show(full[0], full[1], full[2]);
        if (isTimed()) showAllTime();
      },
    };

    svg.replaceWith(place);
    place.append(svg, mark, here);
    place.after(tools);  // beside the caption: in the figure they would cover labels
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
      const idle = event.key.startsWith("Arrow") && view[2] >= full[2]  // then the page scrolls
        && !(isTimed() && action[1]);
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
      if (view[2] < full[2] || isTimed()) act.whole(); else act.zoom(0.4, at(event));
    });

    // A drag marks a range, or moves a zoomed figure. Touch scrolls.
    const isAlongTime = (event) => start.panel
      && Math.abs(event.clientX - start.x) > 2 * Math.abs(event.clientY - start.y);
    svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      const [inside] = axesAt(at(event)), panel = panels.find((each) => each.axes === inside);
      start = { x: event.clientX, y: event.clientY, at: at(event), pans: view[2] < full[2], panel };
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
      const box = place.getBoundingClientRect(), isTime = isAlongTime(event);
      mark.style.left = `${Math.min(start.x, event.clientX) - box.left}px`;
      mark.style.top = isTime ? 0 : `${Math.min(start.y, event.clientY) - box.top}px`;
      mark.style.width = `${Math.abs(event.clientX - start.x)}px`;
      mark.style.height = isTime ? "100%" : `${Math.abs(event.clientY - start.y)}px`;
      mark.classList.add("shown");
    });
    const end = (event) => {
      if (start && !start.pans && event.type === "pointerup") {
        const now = at(event), w = Math.abs(now.x - start.at.x), h = Math.abs(now.y - start.at.y);
        const isMeant = Math.hypot(event.clientX - start.x, event.clientY - start.y) > LEAST;
        if (isMeant && isAlongTime(event)) {
          const { axes: { x: [from, to] }, left, right, t } = start.panel;
          const times = [start.at.x, now.x].sort((a, b) => a - b).map((x) =>
            from + (to - from) * Math.min(1, Math.max(0, (x - left) / (right - left))));
          showTime(times[0] * t, times[1] * t);
        } else if (isMeant) {
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
