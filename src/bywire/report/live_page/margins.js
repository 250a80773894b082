/* Margins of a loop gain L, negative feedback not counted; definitions as in bywire.margins. */

const DEGREE = 180 / Math.PI;
const wrapped = (angle) => angle - 360 * Math.floor((angle + 180) / 360);

/** Return frequency, magnitude and phase [degree], which is followed without jumps. */
function bodeOf(model) {
  const highest = NYQUIST * 0.5 / model.period, ratio = Math.log(highest / LOWEST) / (POINTS - 1);
  const frequency = Array.from({ length: POINTS }, (_, k) => LOWEST * Math.exp(k * ratio));
  const L = frequency.map((f) => responseAt(model, f));
  const phase = [];
  for (const [re, im] of L) {
    const angle = DEGREE * Math.atan2(-im, -re), last = phase.at(-1) ?? angle;
    phase.push(last + wrapped(angle - last));
  }
  // L between -360 and 0 degree is -L between -180 and 180; a loop of finite gain begins near 0.
  const turns = Math.ceil((phase[0] - 180 - 1) / 360);
  return { frequency, L, size: L.map(([re, im]) => Math.hypot(re, im)),
    margin: phase.map((angle) => angle - 360 * turns) };
}

/** Return the gain crossovers, solved for between points. */
function crossingsOf(model, { frequency, size, margin }) {
  const found = [];
  for (let k = 0; k + 1 < size.length; ++k) {
    const falls = size[k] >= 1;
    if (falls === size[k + 1] >= 1) continue;
    let low = frequency[k], high = frequency[k + 1];
    for (let round = 0; round < 60 && low < high; ++round) {
      const middle = 0.5 * (low + high), [re, im] = responseAt(model, middle);
      if (Math.hypot(re, im) >= 1 === falls) low = middle;
      else high = middle;
    }
    const at = 0.5 * (low + high), [re, im] = responseAt(model, at);
    const here = margin[k] + wrapped(DEGREE * Math.atan2(-im, -re) - margin[k]);
    found.push({ at, margin: here, falls, distance: Math.abs(wrapped(here)) });
  }
  return found;
}

/** Return the factor by which the gain may grow, and where that is read [Hz]. */
function gainMargin({ frequency, L }, model) {
  const real = [];
  for (let k = 0; k + 1 < L.length; ++k) {
    const [[a, b], [c, d]] = [L[k], L[k + 1]];
    if (b < 0 === d < 0 || a >= 0) continue;
    const share = b / (b - d);
    real.push({ size: Math.abs(a + share * (c - a)), at: frequency[k] * (frequency[k + 1] / frequency[k]) ** share });
  }
  const last = 0.5 / model.period; // where a sampled one is real
  if (!model.isAnalog) real.push({ size: Math.max(-responseAt(model, last)[0], 0), at: last });
  const able = real.filter(({ size }) => size > 0 && size < 1);
  return able.reduce((least, { size, at }) => (1 / size < least.gain ? { gain: 1 / size, gainAt: at } : least),
    { gain: Infinity, gainAt: NaN });
}

/** Return all margins; only `isStable` where the loop is not. */
function marginsOf(model, bode) {
  if (growthOf(model) >= 1 + ON_BORDER) return { isStable: false };
  const crossings = crossingsOf(model, bode), falls = crossings.filter((each) => each.falls);
  const nearest = falls.length
    ? crossings.reduce((best, each) => (each.distance < best.distance ? each : best)) : { margin: NaN, at: NaN };
  const delays = crossings.map(({ margin, at }) => (margin - 360 * Math.floor(margin / 360)) / 360 / at);
  const most = (value) => bode.L.reduce((largest, [re, im]) => Math.max(largest, value(re, im)), 0);
  return {
    isStable: true, ...gainMargin(bode, model), phase: nearest.margin, phaseAt: nearest.at,
    crossover: falls.at(-1)?.at ?? NaN, delay: delays.length ? Math.min(...delays) : NaN,
    disk: 2 / most((re, im) => Math.hypot(1 - re, im) / Math.hypot(1 + re, im)),
    sensitivity: most((re, im) => 1 / Math.hypot(1 + re, im)),
    complementary: most((re, im) => Math.hypot(re, im) / Math.hypot(1 + re, im)),
  };
}

/** Return Bode diagram and margins of a loop at the module's parameters, or why there are none. */
function loopAt(exported, loop) {
  const jacobians = jacobiansOf(exported, loop), model = jacobians && gainOf(jacobians, loop);
  if (!model) return { reason: "no operating point with these values: a contact opens or closes there" };
  const bode = bodeOf(model);
  return { frequency: bode.frequency, decibel: bode.size.map((size) => 20 * Math.log10(size)),
    phase: bode.margin.map((margin) => margin - 180), margins: marginsOf(model, bode) };
}
