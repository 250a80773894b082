// Loads a run that was exported as WebAssembly. All values are SI.

/** Return whether all values are finite numbers; a loop is faster than a callback per value. */
function areFinite(values) {
  for (let k = 0; k < values.length; ++k) if (!Number.isFinite(values[k])) return false;
  return true;
}

/** Check parameter values and return the kernel's parameter vector. */
function vectorOf(description, values) {
  const vector = Float64Array.from(description.parameters, (each) => each.start);
  const places = new Map(description.parameters.map((each, k) => [each.name, k]));
  for (const [name, value] of Object.entries(values)) {
    const k = places.get(name);
    if (k === undefined) throw new RangeError(`unknown parameter '${name}'`);
    const { low, high, unit, range } = description.parameters[k];
    const isWithin = typeof value === "number" && Number.isFinite(value)
      && value >= (low ?? -Infinity) && value <= (high ?? Infinity);
    if (!isWithin) {
      const shown = unit === "1" ? `${value}` : `${value} ${unit}`;
      throw new RangeError(`${name} = ${shown} is not valid: it must be ${range}`);
    }
    vector[k] = value;
  }
  return vector;
}

/** Return the rows of the stimulus; each signal is an array of rows or a list of [time, value] steps. */
function rowsOf(description, given, count, interval) {
  const names = description.stimulus.map((each) => each.name);
  const rows = new Float64Array(count * names.length);
  for (const name of Object.keys(given))
    if (!names.includes(name)) throw new RangeError(`unknown stimulus '${name}'`);
  names.forEach((name, k) => {
    const course = given[name] ?? description.stimulus[k].steps;
    if (ArrayBuffer.isView(course)) {
      if (course.length < count)
        throw new RangeError(`${name} has ${course.length} rows, but the run needs ${count}`);
      for (let row = 0; row < count; ++row) rows[row * names.length + k] = course[row];
      return;
    }
    let at = -1;
    for (let row = 0; row < count; ++row) {
      while (at + 1 < course.length && course[at + 1][0] <= (row + 1e-6) * interval) ++at;
      rows[row * names.length + k] = at < 0 ? 0 : course[at][1];
    }
  });
  if (!areFinite(rows)) throw new RangeError("the stimulus must contain only finite numbers");
  description.stimulus.forEach(({ name, low, high }, k) => {
    for (let at = k; at < rows.length; at += names.length)
      if (rows[at] < (low ?? -Infinity) || rows[at] > (high ?? Infinity))
        throw new RangeError(`${name} = ${rows[at]} is not valid: it must be from ${low ?? "-∞"} to ${high ?? "∞"}`);
  });
  return rows;
}

/**
 * Compile a module, which can then run any number of times.
 *
 * `run(parameters, { stimulus, duration })` returns `{ time, signals, table, settled }`. `signals`
 * contains a Float64Array for each signal name, and `table` contains all signals row by row. The rows
 * are the bench's. Omitted parameters and stimuli have the bench's values. Noise is zero unless you
 * pass it as rows.
 */
export async function load(bytes, description) {
  const { exp, log, sin, cos, tan, atan, tanh, pow } = Math;
  const math = { exp, log, sin, cos, tan, atan, tanh, pow };
  const formulas = new WebAssembly.Table({ element: "anyfunc", initial: 1 });
  const env = { __indirect_function_table: formulas };
  const { module, instance } = await WebAssembly.instantiate(bytes, { math, env });
  const { memory, parameters, working, room, begin, advance } = instance.exports;
  const [table] = WebAssembly.Module.customSections(module, "formulas");
  const made = await functionsOf(table, { ...math, ...instance.exports }, working());
  formulas.grow(made.length);
  made.forEach((each, k) => formulas.set(k + 1, each));
  const { frame, recordFrames, stimulusFrames, stateLength, unsettledAt } = description;
  const width = description.signals.length;
  return {
    description,
    exports: instance.exports,
    run(values = {}, { stimulus = {}, duration = description.duration } = {}) {
      const vector = vectorOf(description, values);
      const isChanged = vector.some((value, k) => value !== description.parameters[k].start);
      if (!(duration > 0 && Number.isFinite(duration))) throw new RangeError("duration must be > 0");
      const frames = Math.ceil(duration / frame / recordFrames - 1e-9) * recordFrames;
      if (frames > 2 ** 31 - 1)
        throw new RangeError(`duration = ${duration} s is not valid: it must be <= ${(2 ** 31 - 1) * frame} s`);
      const rows = rowsOf(description, stimulus, Math.floor(frames / stimulusFrames) + 1,
        stimulusFrames * frame);
      const count = frames / recordFrames + 1;
      const u = (room() + 15) & ~15, rec = u + rows.byteLength;
      const missing = rec + 8 * count * width - memory.buffer.byteLength;
      if (missing > 0) memory.grow(Math.ceil(missing / 65536));
      new Float64Array(memory.buffer, parameters(), vector.length).set(vector);
      new Float64Array(memory.buffer, u, rows.length).set(rows);
      begin(isChanged ? 1 : 0);
      const begun = new Float64Array(memory.buffer, working(), stateLength);
      if (!areFinite(begun))
        throw new RangeError("the brake has no equilibrium with these parameters");
      advance(u, stimulusFrames, 0, frames, 1, recordFrames, rec);
      const table = new Float64Array(memory.buffer, rec, count * width).slice(); // the next run overwrites it
      const time = new Float64Array(count);
      for (let row = 0; row < count; ++row) time[row] = row * recordFrames * frame;
      const unsettled = new Float64Array(memory.buffer, working(), stateLength)[unsettledAt];
      let signals;
      return {
        time, table, settled: unsettled === 0 && areFinite(table),
        get signals() {
          return (signals ??= Object.fromEntries(description.signals.map(({ name }, k) => {
            const values = new Float64Array(count);
            for (let row = 0, at = k; row < count; ++row, at += width) values[row] = table[at];
            return [name, values];
          })));
        },
      };
    },
  };
}
