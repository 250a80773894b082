/* Key figures of a run, by the definitions of bywire.bench.kpis: a number, or why there is none. */

const undefinedFor = (reason) => ({ value: NaN, reason });
const defined = (value) => ({ value, reason: "" });
const largest = (y) => y.reduce((most, value) => Math.max(most, value), -Infinity);
const least = (y) => y.reduce((few, value) => Math.min(few, value), Infinity);

/** Return the integral by the trapezoidal rule. */
function integralOf(t, y) {
  let sum = 0;
  for (let k = 1; k < t.length; ++k) sum += 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1]);
  return sum;
}

/** Return how many entries come before a value, those that equal it too where they are passed. */
function placeIn(t, at, passEqual) {
  let low = 0, high = t.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (t[middle] < at || (passEqual && t[middle] === at)) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Return the centered moving average over a period; the signal is straight between samples. */
function smoothedOf(t, y, period) {
  const count = t.length;
  if (!(period > 0) || count < 2) return y;
  const width = Math.min(period, t[count - 1] - t[0]);
  const total = new Float64Array(count);
  for (let k = 1; k < count; ++k)
    total[k] = total[k - 1] + 0.5 * (y[k] + y[k - 1]) * (t[k] - t[k - 1]);
  const primitive = (at) => {
    const k = Math.min(Math.max(placeIn(t, at, true) - 1, 0), count - 2), d = at - t[k];
    return total[k] + y[k] * d + 0.5 * (y[k + 1] - y[k]) / (t[k + 1] - t[k]) * d * d;
  };
  return Float64Array.from(t, (now) => {
    const a = Math.min(Math.max(now - 0.5 * width, t[0]), t[count - 1] - width);
    return (primitive(a + width) - primitive(a)) / width;
  });
}

const STEP = ["dead_time", "rise_time", "settling_time", "overshoot", "steady_state_error", "ripple"];

/** Figures of a step response; see bench/kpis/step_response.py. */
function stepFigures(time, signals, setting) {
  const none = (reason) => Object.fromEntries(STEP.map((name) => [name, undefinedFor(reason)]));
  const { t_step: at, window } = setting, tracks = setting.end !== null;
  if (!(time[0] <= at && at < time[time.length - 1])) return none("the step is outside the recording");
  const whole = smoothedOf(time, signals[setting.signal], setting.smoothing);
  const first = placeIn(time, at, true), before = first - 1;
  const share = (at - time[before]) / (time[first] - time[before]);
  const t = [at, ...time.slice(first)];
  const y = [share === 0 ? whole[before] : (whole[first] - whole[before]) * share + whole[before],
    ...whole.slice(first)];
  const last = t.length - 1, end = t[last];
  const [a, b] = window ?? [end - 0.2 * (end - t[0]), end];
  const from = placeIn(t, a, false), to = placeIn(t, b, true);
  if (to - from < 2) return none("the steady state's window holds < 2 samples");
  const [tw, yw] = [t.slice(from, to), y.slice(from, to)];
  const mean = integralOf(tw, yw) / (tw[tw.length - 1] - tw[0]);
  const earlier = whole.slice(0, placeIn(time, at - 0.5 * setting.smoothing, false));
  const start = setting.start ?? (earlier.length
    ? earlier.reduce((sum, value) => sum + value, 0) / earlier.length : y[0]);
  const goal = setting.end ?? mean, height = goal - start, band = largest(yw) - least(yw);
  const flat = !(Math.abs(height) > 1e-12 * Math.max(Math.abs(start), Math.abs(goal)));
  const blind = flat ? "the step height is zero"
    : !tracks && Math.abs(height) <= band ? "the response changes by less than its ripple" : "";
  const z = y.map((value) => (value - start) / height);
  const crossing = (level) => {
    const k = z.findIndex((value) => value >= level);
    if (k < 0) return undefinedFor(`never reaches ${100 * level} % of the step height`);
    if (k === 0) return undefinedFor("there already at the step");
    return defined(t[k - 1] + (level - z[k - 1]) / (z[k] - z[k - 1]) * (t[k] - t[k - 1]) - t[0]);
  };
  const settling = () => {
    let k = last;
    while (k >= 0 && Math.abs(z[k] - 1) <= 0.02) --k;
    if (k === last) return undefinedFor(`never settles: ${digits(100 * z[last])} % at the end`);
    if (k < 0) return defined(0);
    const edge = 1 + (z[k] >= 1 ? 0.02 : -0.02);
    const entry = t[k] + (edge - z[k]) / (z[k + 1] - z[k]) * (t[k + 1] - t[k]);
    return entry > end - 0.1 * (end - t[0])
      ? undefinedFor("enters the band only shortly before the recording ends") : defined(entry - t[0]);
  };
  const [low, high] = [crossing(0.1), crossing(0.9)];
  const given = {
    dead_time: crossing(0.05),
    rise_time: low.reason || high.reason
      ? undefinedFor(low.reason || high.reason) : defined(high.value - low.value),
    settling_time: settling(),
    overshoot: defined(100 * Math.max(0, largest(z) - 1)),
  };
  for (const name of Object.keys(given)) if (blind) given[name] = undefinedFor(blind);
  given.steady_state_error = tracks ? defined(Math.abs(goal - mean)) : undefinedFor("no set point is given");
  given.ripple = defined(band);
  return given;
}

/** What a run costs; see bench/kpis/effort.py. */
function effortFigures(time, signals, { current, power, energy }) {
  const [i, P, E] = [current, power, energy].map((name) => signals[name]);
  const duration = time[time.length - 1] - time[0];
  const sizes = i && i.map(Math.abs);
  const noCurrent = undefinedFor("no current is recorded");
  const drawn = E ? defined(E[E.length - 1] - E[0]) : P ? defined(integralOf(time, P))
    : undefinedFor("neither energy nor electrical power is recorded");
  return {
    peak_current: i ? defined(largest(sizes)) : noCurrent,
    mean_current: i ? defined(integralOf(time, sizes) / duration) : noCurrent,
    peak_power: P ? defined(largest(P)) : undefinedFor("no electrical power is recorded"),
    mean_power: drawn.reason ? drawn : defined(drawn.value / duration),
    energy: drawn,
  };
}

/** How long it is in a mode; see bench/kpis/occupation.py. */
function occupationFigures(time, signals, setting) {
  const duration = time[time.length - 1] - time[0], since = signals[setting.t_stuck];
  const share = (name) => {
    const mode = signals[setting[name]];
    return mode ? defined(integralOf(time, mode) / duration) : undefinedFor("the mode is not recorded");
  };
  return {
    share_stuck: since ? defined((since[since.length - 1] - since[0]) / duration) : share("stuck"),
    share_sat_current: share("sat_current"),
    share_sat_duty: share("sat_duty"),
  };
}

/** Between which values a signal stays; see bench/kpis/extremes.py. */
const extremeFigures = (_, signals, { signal }) =>
  ({ output_max: defined(largest(signals[signal])), output_min: defined(least(signals[signal])) });

const FAMILIES = { step_response: stepFigures, effort: effortFigures, occupation: occupationFigures,
  extremes: extremeFigures };

/** Return all key figures of a run by name. */
function keyFigures(time, signals, settings) {
  return Object.assign({}, ...Object.entries(settings).map(([family, setting]) =>
    FAMILIES[family](time, signals, setting)));
}

/** Return whether a key figure meets its requirement; a figure that is not defined does not. */
function isMet({ value }, { compare, bound }) {
  return compare === "<=" ? value <= bound : compare === ">=" ? value >= bound
    : compare === "<" ? value < bound : value > bound;
}
