/* Key figures of a run, from the C code of their families, which the module contains next to the kernel. */

/** Return the recorded part of a run: after settling, plus the time kept before it. */
function recordingOf({ time, table }, settle, keep) {
  const begin = time.findIndex((t) => t >= settle - keep - 1e-9);
  const since = time.slice(begin).map((t) => Math.round((t - settle) * 1e12) / 1e12);
  return { time: since, table: table.subarray(begin * (table.length / time.length)) };
}

/** Return a number as Python's format shows it: "{:.4g}". */
function formatted(number, spec) {
  const [, digits = "6", kind] = /^(?:\.(\d+))?([gfe]?)$/.exec(spec) ?? [];
  if (kind === "f") return number.toFixed(digits);
  return kind === "e" ? number.toExponential(digits) : String(Number(number.toPrecision(digits)));
}

/** Return the reason why a figure has no value, with the numbers in the text. */
function reasonOf({ text }, numbers) {
  let next = 0;
  return text.replace(/\{:([^}]*)\}/g, (_, spec) => formatted(numbers[next++], spec));
}

/** Return all figures of a family by name: a number, or the reason for its absence. */
function familyOf({ memory, room, ...functions }, { time, table }, names, family) {
  const count = time.length, columns = family.signals.map((name) => names.indexOf(name));
  const here = columns.filter((k) => k >= 0).length, figures = family.figures.length;
  const numbers = count * (1 + here + family.room) + family.setting.length + 5 * figures + 2 * columns.length;
  const begin = (room() + 15) & ~15, missing = begin + 8 * numbers - memory.buffer.byteLength;
  if (missing > 0) memory.grow(Math.ceil(missing / 65536));
  let free = begin;
  const placed = (values) => {
    new Float64Array(memory.buffer, free, values.length).set(values);
    return (free += 8 * values.length) - 8 * values.length;
  };
  const column = (k) => time.map((_, row) => table[row * names.length + k]);
  const t = placed(time), starts = columns.map((k) => (k < 0 ? 0 : placed(column(k))));
  const setting = placed(family.setting), work = free, values = work + 8 * count * family.room;
  const told = values + 8 * figures, rows = told + 24 * figures, reasons = rows + 16 * columns.length;
  const places = new Uint32Array(memory.buffer, rows, 4 * columns.length).fill(0);
  starts.forEach((start, k) => (places[4 * k] = start));
  functions[family.entry](1n, BigInt(count), t, rows, setting, work, values, reasons, told);
  const given = new Float64Array(memory.buffer, values, figures);
  const why = new Int32Array(memory.buffer, reasons, figures);
  const inTexts = new Float64Array(memory.buffer, told, 3 * figures);
  return family.figures.map((name, k) => {
    const none = family.reasons[why[k] - 1];
    if (!none) return [name, { value: given[k], reason: "", open: false }];
    const reason = reasonOf(none, inTexts.subarray(3 * k, 3 * k + 3));
    return [name, { value: NaN, reason, open: none.open }];
  });
}

/** Return all key figures of a run by name. */
const keyFigures = (exported, recording, names, families) =>
  Object.fromEntries(families.flatMap((family) => familyOf(exported, recording, names, family)));
