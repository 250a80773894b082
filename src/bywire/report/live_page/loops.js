/* Sampled or analog loops from the Jacobians that the module computes: response and margins.
 * The definitions are those of bywire.margins. Matrices are arrays of rows. */

const TOUCH = 1e-12; // m, below which a contact is treated as neither closed nor open
const LOWEST = 1e-2, NYQUIST = 0.998, POINTS = 2000; // Hz, fraction of half the sampling frequency
const ON_BORDER = 1e-6; // growth per sample that is still treated as an integrator

const zeros = (rows, columns) => Array.from({ length: rows }, () => new Float64Array(columns));
const eye = (n) => zeros(n, n).map((row, k) => ((row[k] = 1), row));
const plus = (X, Y) => X.map((row, i) => row.map((value, j) => value + Y[i][j]));
const beside = (X, Y) => X.map((row, i) => Float64Array.of(...row, ...Y[i]));

function times(X, Y) {
  const product = zeros(X.length, Y.length ? Y[0].length : 0);
  X.forEach((row, i) => row.forEach((value, k) => {
    if (value !== 0) for (let j = 0; j < Y[k].length; ++j) product[i][j] += value * Y[k][j];
  }));
  return product;
}

/** Return powers of two that divide rows and multiply columns so that both have similar magnitudes. */
function scales(X) {
  const scale = new Float64Array(X.length).fill(1);
  for (let isDone = false, round = 0; !isDone && round < 50; ++round) {
    isDone = true;
    X.forEach((row, i) => {
      let inRow = 0, inColumn = 0;
      for (let j = 0; j < X.length; ++j) {
        if (j === i) continue;
        inRow += Math.abs(row[j]) * scale[j] / scale[i];
        inColumn += Math.abs(X[j][i]) * scale[i] / scale[j];
      }
      if (inRow === 0 || inColumn === 0) return;
      const by = 2 ** Math.round(0.5 * Math.log2(inRow / inColumn));
      if (by !== 1) (scale[i] *= by), (isDone = false);
    });
  }
  return scale;
}

const scaled = (X, scale) => X.map((row, i) => row.map((value, j) => value * scale[j] / scale[i]));

/** Return the exponential: halved until it is small, by its series, and squared again. */
function exponential(X) {
  const scale = scales(X), balanced = scaled(X, scale);
  const size = Math.max(0, ...balanced.map((row) => row.reduce((sum, value) => sum + Math.abs(value), 0)));
  const halvings = Math.max(0, Math.ceil(Math.log2(size)) + 2);
  const small = balanced.map((row) => row.map((value) => value * 2 ** -halvings));
  let sum = eye(X.length);
  for (let k = 16; k > 0; --k)
    sum = plus(eye(X.length), times(small, sum).map((row) => row.map((value) => value / k)));
  for (let k = 0; k < halvings; ++k) sum = times(sum, sum);
  return scaled(sum, scale.map((value) => 1 / value));
}

/** Return the Jacobians of a loop at parameters that lie in the module, or beside its point (side 1, -1); null where it has no point. */
function jacobiansOf({ memory, room, parameters, ...functions }, { entry, size, contacts, states, held, every }, side = 0) {
  const begin = (room() + 15) & ~15, missing = begin + 8 * size - memory.buffer.byteLength;
  if (missing > 0) memory.grow(Math.ceil(missing / 65536));
  const numbers = new Float64Array(memory.buffer, begin, size).fill(0);
  functions[entry](parameters(), side, begin);
  if (!numbers.every(Number.isFinite) || numbers.subarray(0, contacts).some((slack) => slack < TOUCH)) return null;
  let at = contacts;
  const next = (rows, columns) =>
    Array.from({ length: rows }, () => numbers.slice(at, (at += columns)));
  const A = next(states, states), B = next(states, held);
  return { A, B, numbers: numbers.slice(contacts), ticks: every.map(() => ({ X: next(held, states), M: next(held, held) })) };
}

const EQUAL = 1e-5, SAME = 1e-6, FREQUENCIES = 40; // models, numbers that are treated as one; where models are compared

/** Return a loop's gain where both sides of a kink agree; null without a point, "corner" where they do not. */
function modelOf(exported, loop) {
  const found = [0, 1, -1].map((side) => jacobiansOf(exported, loop, side));
  if (found.includes(null)) return null;
  const [here, above, below] = found;
  const differ = (one, other) => one.numbers.some((value, k) =>
    Math.abs(value - other.numbers[k]) > SAME * Math.max(Math.abs(value), Math.abs(other.numbers[k])));
  const model = gainOf(here, loop);
  if (!model || !(differ(here, above) || differ(above, below))) return model;
  const [one, other] = [gainOf(above, loop), gainOf(below, loop)];
  if (unlike(one, other)) return "corner";
  return unlike(one, model) ? one : model;
}

/** Return whether two loop gains differ at any frequency. */
function unlike(one, other) {
  const highest = NYQUIST * 0.5 / one.period;
  for (let k = 0; k < FREQUENCIES; ++k) {
    const f = LOWEST * (highest / LOWEST) ** (k / (FREQUENCIES - 1));
    const [a, b] = responseAt(one, f), [c, d] = responseAt(other, f);
    if (!(Math.hypot(a - c, b - d) <= EQUAL * Math.max(Math.hypot(a, b), Math.hypot(c, d)) + 1e-12)) return true;
  }
  return false;
}

/** Return the effect of successive tasks at the same time on memory X x + M m + U u. */
const after = ({ X, M, U }, tick) => ({
  X: plus(tick.X, times(tick.M, X)), M: times(tick.M, M), U: times(tick.M, U),
});

/** Return the first instant's ticks with the cut in place of what is read there, and what comes back. */
function cutOpen({ A, ticks }, { cut, held, every }) {
  const n = A.length, column = cut.at;
  let now = { X: zeros(held, n), M: eye(held), U: zeros(held, 1) };
  const back = new Float64Array(n + held);
  if (cut.isState) back[column] = 1;
  const reads = ({ X }) => X.some((row) => row[column] !== 0);
  const writes = ({ X, M }) => X[column].some((value) => value !== 0)
    || M[column].some((value, k) => value !== (k === column ? 1 : 0));
  const owners = ticks.flatMap((tick, k) => ((cut.isState ? reads : writes)(tick) ? [k] : []));
  if (!owners.length) return { isNothing: true };
  if (owners.length !== 1 || every[owners[0]] !== every.reduce(leastCommon)) return null;
  ticks.forEach((tick, k) => {
    if (k !== owners[0]) return (now = after(now, tick));
    if (cut.isState) {
      const rest = tick.X.map((row) => row.map((value, j) => (j === column ? 0 : value)));
      now = after(now, { X: rest, M: tick.M });
      now.U = plus(now.U, tick.X.map((row) => [row[column]]));
    } else {
      now = after(now, tick);
      back.set(now.X[column]);
      back.set(now.M[column], n);
      [now.X, now.M, now.U].forEach((rows) => rows[column].fill(0));
      now.U[column][0] = 1;
    }
  });
  return { now, back };
}

const divisor = (a, b) => (b ? divisor(b, a % b) : a);
const leastCommon = (a, b) => a / divisor(a, b) * b;

/** Return an analog loop's gain: readers of the cut state read an input; the state's own decay is not feedback and stays. */
function analogGain({ A }, { cut: { at }, every, frame }) {
  const B = A.map((row, i) => (i === at ? 0 : row[at]));
  const opened = A.map((row, i) => row.map((value, j) => (j === at && i !== at ? 0 : value)));
  const C = A.map((_, k) => (k === at ? -1 : 0));
  return { ...effective(opened, B, C, every.reduce(leastCommon) * frame), isAnalog: true };
}

/** Return the loop gain as a model, the cut its input and (with a minus) its output. */
function gainOf(found, loop) {
  if (loop.isAnalog) return analogGain(found, loop);
  const opened = cutOpen(found, loop);
  if (!opened) return null;
  if (opened.isNothing) return effective([], [], [], loop.every.reduce(leastCommon) * loop.frame);
  const { states: n, held: m, every, frame } = loop, common = every.reduce(leastCommon);
  const W = zeros(n + m, n + m);
  found.A.forEach((row, i) => { W[i].set(row.map((value) => value * frame)); });
  found.B.forEach((row, i) => { W[i].set(row.map((value) => value * frame), n); });
  const whole = exponential(W);
  const A = whole.slice(0, n).map((row) => row.slice(0, n)), B = whole.slice(0, n).map((row) => row.slice(n));
  let F = eye(n + m), G = zeros(n + m, 1);
  for (let f = 0; f < common; ++f) {
    let now = opened.now;
    if (f > 0) {
      now = { X: zeros(m, n), M: eye(m), U: zeros(m, 1) };
      found.ticks.forEach((tick, k) => { if (f % every[k] === 0) now = after(now, tick); });
    }
    const step = [...beside(plus(A, times(B, now.X)), times(B, now.M)), ...beside(now.X, now.M)];
    F = times(step, F);
    G = plus(times(step, G), [...times(B, now.U), ...now.U]);
  }
  return effective(F, G.map(([value]) => value), opened.back.map((value) => -value), common * frame);
}

/** Return the reachable and observable part of a model, with balanced states. */
function effective(A, B, C, period) {
  const spread = (from, next) => {
    const reached = Array.from(from, (value) => value !== 0);
    for (let round = 0; round < A.length; ++round)
      A.forEach((_, i) => { reached[i] ||= A.some((__, j) => reached[j] && next(i, j) !== 0); });
    return reached;
  };
  const forward = spread(B, (i, j) => A[i][j]), backward = spread(C, (i, j) => A[j][i]);
  const kept = A.flatMap((_, k) => (forward[k] && backward[k] ? [k] : []));
  const small = kept.map((i) => kept.map((j) => A[i][j])), scale = scales(small);
  return {
    A: scaled(small, scale), B: kept.map((k, i) => B[k] / scale[i]), C: kept.map((k, i) => C[k] * scale[i]), period,
  };
}

/** Return the response C (z - A)^-1 B at a frequency [Hz], by elimination with the largest pivots; of an analog model, at s. */
function responseAt({ A, B, C, period, isAnalog }, frequency) {
  const n = A.length, omega = 2 * Math.PI * frequency;
  const [x, y] = isAnalog ? [0, omega] : [Math.cos(omega * period), Math.sin(omega * period)];
  const re = A.map((row, i) => Float64Array.of(...row.map((value) => -value), B[i]));
  const im = A.map(() => new Float64Array(n + 1));
  for (let i = 0; i < n; ++i) (re[i][i] += x), (im[i][i] = y);
  for (let k = 0; k < n; ++k) {
    let best = k, largest = 0;
    for (let i = k; i < n; ++i) {
      const square = re[i][k] * re[i][k] + im[i][k] * im[i][k];
      if (square > largest) [best, largest] = [i, square];
    }
    [re[k], re[best]] = [re[best], re[k]];
    [im[k], im[best]] = [im[best], im[k]];
    const a = re[k], b = im[k], size = a[k] * a[k] + b[k] * b[k];
    for (let i = k + 1; i < n; ++i) {
      const c = re[i], d = im[i];
      if (c[k] === 0 && d[k] === 0) continue;
      const share = (c[k] * a[k] + d[k] * b[k]) / size, turned = (d[k] * a[k] - c[k] * b[k]) / size;
      for (let j = k + 1; j <= n; ++j) {
        c[j] -= share * a[j] - turned * b[j];
        d[j] -= share * b[j] + turned * a[j];
      }
    }
  }
  let real = 0, imaginary = 0;
  for (let k = n - 1; k >= 0; --k) {
    const a = re[k], b = im[k];
    for (let j = k + 1; j < n; ++j) {
      a[n] -= a[j] * re[j][n] - b[j] * im[j][n];
      b[n] -= a[j] * im[j][n] + b[j] * re[j][n];
    }
    const size = a[k] * a[k] + b[k] * b[k], value = (a[n] * a[k] + b[n] * b[k]) / size;
    b[n] = (b[n] * a[k] - a[n] * b[k]) / size;
    a[n] = value;
    real += C[k] * a[n];
    imaginary += C[k] * b[n];
  }
  return [real, imaginary];
}

/** Return the closed loop's growth in a sample, or as long: the root of a high power's size. */
function growthOf({ A, B, C, period, isAnalog }) {
  if (!A.length) return 0; // no feedback
  const closed = A.map((row, i) => Float64Array.from(row, (value, j) => value - B[i] * C[j]));
  let X = isAnalog ? exponential(closed.map((row) => row.map((value) => value * period))) : closed;
  let total = 0, power = 1;
  for (let k = 0; k < 40; ++k) {
    const size = Math.max(0, ...X.map((row) => row.reduce((sum, value) => sum + Math.abs(value), 0)));
    if (size === 0) return 0;
    total += Math.log(size) / power;
    X = X.map((row) => row.map((value) => value / size));
    X = times(X, X);
    power *= 2;
  }
  return Math.exp(total);
}
