/* Panels of curves over one time axis, the current run above those that were kept. */

const HEIGHT = 150; // px of a panel of height 1
const NEAR = 0.5; // share of a limit from which its lines are drawn
const DASHES = { "set point": [6, 4], limit: [2, 4], stated: [7, 3] };

/** Return the colors of the page as they are: they change with its theme. */
function palette() {
  const style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue(`--${name}`).trim();
  return { ink: color("faint"), line: color("line"), bar: color("bar"), limit: color("bad"),
    main: color("main"), second: color("second"), third: color("third"), "set point": color("ink"), kept: color("kept") };
}

/** Return a signal as it is shown; it is not copied where that is as it is computed. */
const converted = (values, quantity) =>
  quantity.factor === 1 && quantity.offset === 0 ? values : values.map((value) => shownOf(value, quantity));

/** Return the lines of a panel: traces of the run, its limit, what a source states, and first traces of kept runs. */
function linesOf(panel, kept, colors) {
  const lines = panel.traces.map(({ label, role }) => ({
    label, stroke: colors[role] ?? colors.third, width: role === "main" ? 2 : 1.5,
    dash: DASHES[role], points: { show: false },
    paths: panel.levels.length ? uPlot.paths.stepped({ align: 1 }) : undefined,
  }));
  const limits = panel.limit
    ? [1, -1].map(() => ({ label: "limit", stroke: colors.limit, dash: DASHES.limit, points: { show: false } }))
    : [];
  const stated = panel.stated.map(({ label }) => (
    { label, stroke: colors.third, width: 1.5, dash: DASHES.stated, points: { show: false } }));
  const others = kept.map(({ name }) => ({
    label: name, stroke: colors.kept, width: 1.5, dash: [8, 3, 2, 3], points: { show: false },
  }));
  return [{ label: "time" }, ...lines, ...limits, ...stated, ...others];
}

/** Return the numbers of a panel's lines, in their order. */
function numbersOf(panel, run, kept, values) {
  const { time } = run, column = ({ name }, { signals }) => converted(signals[name], panel);
  const traces = panel.traces.map((trace) => column(trace, run));
  const limits = [];
  if (panel.limit) {
    const bound = shownOf(values[panel.limit], panel);
    const largest = traces[0].reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    for (const sign of [1, -1])
      limits.push(Array(time.length).fill(largest > NEAR * bound ? sign * bound : null));
  }
  const stated = panel.stated.map(({ value }) => Array(time.length).fill(shownOf(value, panel)));
  return [time, ...traces, ...limits, ...stated, ...kept.map((each) => column(panel.traces[0], each))];
}

/** Draw a bar along the upper edge while a signal is 1. */
function barOf(panel, runNow, colors) {
  return (plot) => {
    const on = panel.saturation && runNow()?.signals[panel.saturation];
    if (!on) return;
    const { ctx, bbox } = plot, { time } = runNow();
    ctx.save();
    ctx.fillStyle = colors.bar;
    for (let k = 0; k + 1 < time.length; ++k)
      if (on[k] > 0.5) {
        const from = Math.max(bbox.left, plot.valToPos(time[k], "x", true));
        const to = Math.min(bbox.left + bbox.width, plot.valToPos(time[k + 1], "x", true));
        if (to > from) ctx.fillRect(from, bbox.top, to - from, 5 * devicePixelRatio);
      }
    ctx.restore();
  };
}

/** Make the plots of all panels; `draw(run, kept, values)` shows a run. */
function curves(place, panels) {
  let plots = [], shape = "", current = null, waiting = new Map(), later = 0;
  const inSight = new Set();
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) inSight[isIntersecting ? "add" : "delete"](target);
    show(inSight);
  }, { rootMargin: "25%" });
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
    const colors = palette();
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
      const names = panel.levels;
      return new uPlot({
        width: width(), height: HEIGHT * panel.height + (last ? 50 : 30),
        scales: { x: { time: false } }, legend: { live: true },
        cursor: { sync: { key: "time" }, drag: { x: true, y: false } },
        series: linesOf(panel, kept, colors), hooks: { draw: [barOf(panel, () => current, colors)] },
        axes: [
          { ...axis, label: last ? "time [s]" : undefined, labelSize: 20, size: 30 },
          { ...axis, label: panel.quantity + unit, labelSize: 20, size: 62,
            ...(names.length && { splits: () => names.map((_, level) => level),
              values: (_, levels) => levels.map((level) => names[level] ?? "") }) },
        ],
      }, null, figure);
    });
  }
  function draw(run, kept, values) {
    current = run;
    const now = `${width()} ${kept.map(({ name }) => name)}`;
    if (now !== shape) make(kept);
    shape = now;
    waiting = new Map(plots.map((plot, k) =>
      [plot.root.parentElement, () => plot.setData(numbersOf(panels[k], run, kept, values))]));
    show(inSight); // the others when sliders rest, or they come into sight
    clearTimeout(later);
    later = setTimeout(() => show(), REST);
  }
  return { draw, forget: () => { shape = ""; } };
}
