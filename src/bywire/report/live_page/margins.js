/* Margins of a loop gain L, negative feedback not counted; definitions as in bywire.margins. */

const NO_LOOP = 1e-9, LEAST_FACTOR = 1e-9; // loop gain that is treated as zero; minimum factor, at a pole on the stability limit
const SLOWEST = 1e-6, SLOW_POINTS = 40; // below the diagram, where the loop gain is real, Hz
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

/** Return the factors by which the gain may increase and decrease, and their frequencies [Hz]. */
function gainMargins({ frequency, L }, model) {
  const slow = Array.from({ length: SLOW_POINTS }, (_, k) => SLOWEST * (LOWEST / SLOWEST) ** (k / SLOW_POINTS));
  const f = [...slow, ...frequency], values = [...slow.map((at) => responseAt(model, at)), ...L], found = [];
  const take = (real, at) => { if (Number.isFinite(real) && real < 0) found.push({ factor: -1 / real, at }); };
  const solved = (low, high) => {
    const isBelow = responseAt(model, low)[1] < 0;
    for (let round = 0; round < 60 && low < high; ++round) {
      const middle = 0.5 * (low + high);
      if (responseAt(model, middle)[1] < 0 === isBelow) low = middle;
      else high = middle;
    }
    return 0.5 * (low + high);
  };
  take(responseAt(model, 0)[0], 0);
  for (let k = 0; k + 1 < f.length; ++k) {
    const [[a, b], [c, d]] = [values[k], values[k + 1]];
    if (b < 0 === d < 0 || a + b / (b - d) * (c - a) >= 0) continue;
    const at = solved(f[k], f[k + 1]);
    take(responseAt(model, at)[0], at);
  }
  const last = 0.5 / model.period; // where a sampled one is real
  if (!model.isAnalog) take(responseAt(model, last)[0], last);
  const upper = found.filter(({ factor }) => factor > 1).sort((a, b) => a.factor - b.factor)[0];
  const lower = found.filter(({ factor }) => factor > LEAST_FACTOR && factor < 1).sort((a, b) => b.factor - a.factor)[0];
  return { gain: upper?.factor ?? Infinity, gainAt: upper?.at ?? NaN,
    lower_gain: lower?.factor ?? 0, lowerGainAt: lower?.at ?? NaN };
}

/** Return all margins; of an unstable loop only `isStable`. */
function marginsOf(model, bode) {
  const isStable = growthOf(model) < 1 + ON_BORDER;
  if (!bode.size.some((size) => size > NO_LOOP)) return { isStable, hasLoop: false };
  if (!isStable) return { isStable };
  const crossings = crossingsOf(model, bode), falls = crossings.filter((each) => each.falls);
  const nearest = falls.length
    ? crossings.reduce((best, each) => (each.distance < best.distance ? each : best)) : { margin: NaN, at: NaN };
  const delays = crossings.map(({ margin, at }) => (margin - 360 * Math.floor(margin / 360)) / 360 / at);
  const most = (value) => bode.L.reduce((largest, [re, im]) => Math.max(largest, value(re, im)), 0);
  return {
    isStable: true, hasLoop: true, ...gainMargins(bode, model), phase: nearest.margin, phaseAt: nearest.at,
    crossover: falls.at(-1)?.at ?? NaN, delay: delays.length ? Math.min(...delays) : NaN,
    disk: 2 / most((re, im) => Math.hypot(1 - re, im) / Math.hypot(1 + re, im)),
    sensitivity: most((re, im) => 1 / Math.hypot(1 + re, im)),
    complementary: most((re, im) => Math.hypot(re, im) / Math.hypot(1 + re, im)),
  };
}

/** Return Bode diagram and margins of a loop at the module's parameters, or the reason for their absence. */
function loopAt(exported, loop) {
  const model = modelOf(exported, loop);
  if (model === "corner") return { reason: "the operating point is at a kink of the model, where the loop gain differs between the two sides. " +
    `Run bywire margins ${loop.name} to see the operation` };
  if (!model) return { reason: "no operating point with these values, because a contact opens or closes there" };
  const bode = bodeOf(model);
  return { frequency: bode.frequency, decibel: bode.size.map((size) => 20 * Math.log10(size)),
    phase: bode.margin.map((margin) => margin - 180), margins: marginsOf(model, bode) };
}
