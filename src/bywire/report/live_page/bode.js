/* Bode diagrams of the bench's loops with their margins, drawn when the sliders rest. */

const LEAST = { decibel: -80, phase: -450 }; // no margin is determined below

/** Return the margins in words, or the reason for their absence; `shown`: name, title, unit and factor of each. */
function marginText({ reason, margins }, shown) {
  if (reason) return reason;
  if (margins.hasLoop === false) return "no closed loop with these values: the loop gain is 0 at all frequencies";
  if (!margins.isStable) return "the loop is unstable with these values";
  return shown.filter(([name]) => !Number.isNaN(margins[name])).map(([name, title, unit, factor]) =>
    `${title} ${margins[name] === Infinity ? "∞" : digits(margins[name] * factor)} ${unit}`.trim()).join(", ");
}

/** Draw a margin as a bar from one level to another at a frequency. */
const markOf = (result, at, from, to) => clipped((ctx, _, plot) => {
  const { margins } = result(), f = margins?.hasLoop ? at(margins) : NaN;
  if (!Number.isFinite(f) || !Number.isFinite(to(margins))) return;
  const x = plot.valToPos(f, "x", true);
  ctx.strokeStyle = palette().limit;
  ctx.lineWidth = 3 * devicePixelRatio;
  ctx.setLineDash([]);
  ctx.beginPath();
  ctx.moveTo(x, plot.valToPos(from, "y", true));
  ctx.lineTo(x, plot.valToPos(to(margins), "y", true));
  ctx.stroke();
});

/** Make the diagrams of a loop; `draw(result)` shows it. */
function bodeView(place, loop) {
  const text = element("p", { role: "status" });
  const figure = element("figure", { "aria-label": `Bode diagram of the loop ${loop.name}` });
  place.append(element("h3", {}, `Loop ${loop.name}`),
    element("p", { class: "summary" }, `${loop.summary}; ${loop.isAnalog ? "" : "sampled, "}cut at ${loop.cutName}, ` +
      `${loop.point}, without dry friction`), text, figure);
  let plots = [], shape = "", now = null;
  const parts = [
    { key: "decibel", label: "gain [dB]", level: 0, mark: markOf(() => now, (m) => m.gainAt, 0, (m) => -20 * Math.log10(m.gain)) },
    { key: "phase", label: "phase [deg]", level: -180, mark: markOf(() => now, (m) => m.phaseAt, -180, (m) => m.phase - 180) },
  ];
  function make(width) {
    const colors = palette();
    plots.forEach((plot) => plot.destroy());
    const axis = { stroke: colors.ink, grid: { stroke: colors.line, width: 1 }, ticks: { stroke: colors.line },
      labelSize: 20, labelFont: "600 11px system-ui, sans-serif" };
    plots = parts.map(({ key, label, mark }, k) => new uPlot({
      width, height: HEIGHT + (k ? 50 : 30),
      scales: {
        x: { time: false, distr: 3, range: (_, low, high) => [Math.max(low, loop.from / 10), high] },
        y: { range: (_, low, high) => uPlot.rangeNum(Math.max(low, LEAST[key]), high, 0.1, true) },
      },
      legend: { live: true }, hooks: { draw: [mark] },
      cursor: { sync: { key: `bode ${loop.name}` }, drag: { x: true, y: false } },
      series: [{ label: "frequency", value: (_, f) => reading(f, "Hz") },
        { label: label.split(" ")[0], value: (_, number) => reading(number, key === "phase" ? "°" : "dB"), stroke: colors.main, width: 2, points: { show: false } },
        { label: "limit", value: () => "", stroke: colors["set point"], dash: DASHES["set point"], points: { show: false } }],
      axes: [{ ...axis, label: k ? "frequency [Hz]" : undefined, size: 30,
        filter: (_, splits) => splits.map((f) => (Number.isInteger(Math.round(1e6 * Math.log10(f)) / 1e6) ? f : null)) },
      { ...axis, label, size: 62 }],
    }, null, figure));
  }
  return {
    forget: () => { shape = ""; },
    draw(result = now) {
      if (!result) return;
      now = result;
      text.textContent = marginText(result, loop.margins);
      figure.hidden = !result.frequency;
      if (!result.frequency) return;
      const width = Math.max(280, place.clientWidth);
      if (String(width) !== shape) make(width);
      shape = String(width);
      plots.forEach((plot, k) => plot.setData([result.frequency, result[parts[k].key],
        result.frequency.map(() => parts[k].level)]));
    },
  };
}
