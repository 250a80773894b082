/* Panels of curves over one time axis, the current run above the kept runs. */

const HEIGHT = 150; // px of a panel of height 1
const NEAR = 0.5; // fraction of a limit above which its lines are drawn
const OFF = 0.25; // px by which a drawn line may be off a point
const DENSE = 4; // points in a column of pixels from which their extremes are drawn
const KEPT_DASHES = [[8, 3, 2, 3], [2, 3], [12, 4], [6, 3, 2, 3, 2, 3]]; // of kept runs, in their order
const DASHES = { "set point": [6, 4], limit: [2, 4], stated: [7, 3] };

/** Return the page's current colors, which change with its theme. */
function palette() {
  const style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue(`--${name}`).trim();
  return { ink: color("faint"), line: color("line"), bar: color("bar"), limit: color("bad"),
    main: color("main"), second: color("second"), third: color("third"), "set point": color("ink"), kept: color("kept") };
}

/** Return a signal in its display unit; a signal already in that unit is not copied. */
const converted = (values, quantity) =>
  quantity.factor === 1 && quantity.offset === 0 ? values : values.map((value) => shownOf(value, quantity));

/** Return the rows at which a line bends: all between are within `off` of it, along y. x ascends. */
function bendsOf(x, y, from, to, off) {
  const bends = [from];
  let at = from, low = -Infinity, high = Infinity;
  for (let k = from + 1; k <= to; ++k) {
    let slope = (y(k) - y(at)) / (x(k) - x(at));
    if (!(slope >= low && slope <= high)) {
      bends.push((at = k - 1));
      [low, high] = [-Infinity, Infinity];
      slope = (y(k) - y(at)) / (x(k) - x(at));
    }
    const wide = off / (x(k) - x(at));
    low = Math.max(low, slope - wide);
    high = Math.min(high, slope + wide);
  }
  bends.push(to);
  return bends;
}

/** Return a line for uPlot through its bends only, because the time of a stroke depends on its number of corners. */
function lineOf(plot, series, from, to) {
  const { bbox, scales, data } = plot;
  if (to - from > DENSE * bbox.width) return uPlot.paths.linear()(plot, series, from, to);
  const [x, y] = [["x", data[0]], ["y", data[series]]].map(([axis, values]) => {
    const { min, max } = scales[axis], first = plot.valToPos(min, axis, true);
    const each = (plot.valToPos(max, axis, true) - first) / (max - min);
    return (k) => first + each * (values[k] - min);
  });
  const stroke = new Path2D();
  for (const k of bendsOf(x, y, from, to, OFF)) stroke.lineTo(Math.round(x(k)), Math.round(y(k)));
  return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
}

/** Return the lines of a panel: traces of the run, and first traces of kept runs. */
function linesOf(panel, kept, colors) {
  const value = (_, number) => reading(number, panel.unit, panel.levels);
  const lines = panel.traces.map(({ label, role }) => ({
    label, value, stroke: colors[role] ?? colors.third, width: role === "main" ? 2 : 1.5,
    dash: DASHES[role], points: { show: false },
    paths: panel.levels.length ? uPlot.paths.stepped({ align: 1 }) : lineOf,
  }));
  const others = kept.map(({ name }, k) => ({
    label: name, value, stroke: colors.kept, width: 1.5, dash: KEPT_DASHES[k % KEPT_DASHES.length], points: { show: false }, paths: lineOf,
  }));
  return [{ label: "time", value: (_, time) => reading(time, "s") }, ...lines, ...others];
}

/** Return the numbers of a panel's lines, in their order. */
function numbersOf(panel, run, kept) {
  const column = ({ name }, { signals }) => converted(signals[name], panel);
  return [run.time, ...panel.traces.map((trace) => column(trace, run)),
    ...kept.map((each) => column(panel.traces[0], each))];
}

/** Return the levels below a panel's curves: values stated by a source, and the limit that the curves approach. */
function marksOf(panel, largest, values) {
  const at = (value) => shownOf(value, panel), bound = panel.limit && at(values[panel.limit]);
  const limits = panel.limit && largest > NEAR * bound ? [bound, -bound] : [];
  return [...panel.stated.map(({ low, high, levels }) => (
    { role: "stated", low: at(low), high: at(high), levels: levels.map(at) })),
  ...limits.map((level) => ({ role: "limit", low: level, high: level, levels: [level] }))];
}

/** Return a drawing that stays within the axes. */
const clipped = (draw) => (plot) => {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  draw(ctx, bbox, plot);
  ctx.restore();
};

/** Draw ranges as bands, and levels as lines across the axes. */
const drawMarks = (marks, color) => clipped((ctx, { left, width }, plot) => {
  const place = (value) => plot.valToPos(value, "y", true);
  for (const { low, high, levels, role } of marks()) {
    ctx.fillStyle = ctx.strokeStyle = color(role);
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash(DASHES[role].map((length) => length * devicePixelRatio));
    ctx.globalAlpha = 0.15;
    ctx.fillRect(left, place(high), width, place(low) - place(high));
    ctx.globalAlpha = 1;
    ctx.beginPath();
    for (const level of levels) {
      ctx.moveTo(left, place(level));
      ctx.lineTo(left + width, place(level));
    }
    ctx.stroke();
  }
});

/** Draw a bar along the upper edge while a signal is 1. */
const drawBar = (panel, runNow, colors) => clipped((ctx, { top }, plot) => {
  const on = panel.saturation && runNow()?.signals[panel.saturation];
  if (!on) return;
  const { time } = runNow(), place = (k) => plot.valToPos(time[k], "x", true);
  ctx.fillStyle = colors.bar;
  for (let k = 0; k + 1 < time.length; ++k)
    if (on[k] > 0.5) ctx.fillRect(place(k), top, place(k + 1) - place(k), 5 * devicePixelRatio);
});

/** Add the levels below the curves to the legend. */
function named(plot, marks, color) {
  for (const { label, role } of marks) {
    const swatch = element("div", { class: "u-marker" }), name = element("div", { class: "u-label" }, label);
    swatch.style.border = `2px dashed ${color(role)}`;
    plot.root.querySelector(".u-legend").append(element("tr", { class: "u-series mark" }, element("td", {}, swatch, name)));
  }
}

/** Return the range of time that a plot shows; null if it shows all of it. */
function zoomOf(plot) {
  const time = plot?.data[0] ?? [], { min, max } = plot?.scales.x ?? {};
  return time.length && (min > time[0] || max < time.at(-1)) ? { min, max } : null;
}

/** Make the plots of all panels; `draw(run, kept, values)` shows a run. */
function curves(place, panels) {
  let plots = [], shape = "", current = null, zoom = null, waiting = new Map(), later = 0;
  const marks = panels.map(() => []), inSight = new Set();
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) inSight[isIntersecting ? "add" : "delete"](target);
    show(inSight);
  });
  /* Draw what waits, of all panels or of some. */
  function show(figures) {
    for (const [figure, set] of waiting)
      if (!figures || figures.has(figure)) {
        waiting.delete(figure);
        set();
      }
  }
  const width = () => Math.max(280, place.clientWidth);
  function make(kept) {
    const colors = palette(), color = (role) => (role === "limit" ? colors.limit : colors.third);
    plots.forEach((plot) => plot.destroy());
    observer.disconnect();
    inSight.clear();
    place.replaceChildren();
    plots = panels.map((panel, k) => {
      const last = k === panels.length - 1, unit = panel.unit && ` [${panel.unit}]`;
      const axis = { stroke: colors.ink, grid: { stroke: colors.line, width: 1 },
        ticks: { stroke: colors.line }, labelFont: "600 11px system-ui, sans-serif" };
      const figure = element("figure", { "aria-label": `${panel.quantity} over time` });
      place.append(figure);
      observer.observe(figure);
      const names = panel.levels, ends = () => marks[k].flatMap(({ low, high }) => [low, high]);
      const plot = new uPlot({
        width: width(), height: HEIGHT * panel.height + (last ? 50 : 30),
        scales: { x: { time: false }, y: { range: ({ series, data }, low, high) => {
          if (low === null) return [null, null];
          const [first, last] = series[0].idxs, isWhole = first === 0 && last === data[0].length - 1;
          const shown = isWhole ? ends() : []; // for a part of the time, only the curves
          return uPlot.rangeNum(Math.min(low, ...shown), Math.max(high, ...shown), 0.1, true);
        } } },
        legend: { live: true, markers: { dash: ({ series }, k) => (series[k].dash ? "dashed" : "solid") } },
        cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
        series: linesOf(panel, kept, colors),
        hooks: { drawAxes: [drawMarks(() => marks[k], color)], draw: [drawBar(panel, () => current, colors)] },
        axes: [
          { ...axis, label: last ? "time [s]" : undefined, labelSize: 20, size: 30 },
          { ...axis, label: panel.quantity + unit, labelSize: 20, size: 62,
            ...(names.length && { splits: () => names.map((_, level) => level),
              values: (_, levels) => levels.map((level) => names[level] ?? "") }) },
        ],
      }, null, figure);
      const limit = panel.limit ? [{ label: "limit", role: "limit" }] : [];
      named(plot, [...panel.stated.map(({ label }) => ({ label, role: "stated" })), ...limit], color);
      return plot;
    });
    place.append(element("p", { class: "meaning zoom" }, "Drag over a plot to zoom in on a time range. Double-click to show the whole run."));
  }
  function draw(run, kept, values) {
    current = run;
    const now = `${width()} ${kept.map(({ name }) => name)}`;
    if (plots[0]?.data[0]?.length) zoom = zoomOf(plots[0]);
    if (now !== shape) make(kept);
    shape = now;
    waiting = new Map(plots.map((plot, k) => [plot.root.parentElement, () => {
      const numbers = numbersOf(panels[k], run, kept);
      const largest = numbers[1].reduce((most, value) => Math.max(most, Math.abs(value)), 0);
      marks[k] = marksOf(panels[k], largest, values);
      plot.batch(() => {
        plot.setData(numbers);
        if (zoom) plot.setScale("x", zoom); // new values keep the zoom
      });
    }]));
    show(inSight); // the others when sliders rest or the plots become visible
    clearTimeout(later);
    later = setTimeout(() => show(), REST);
  }
  return { draw, forget: () => { shape = ""; } };
}
