/* Key figures of a run, by the C of their families, which stands in the module beside the kernel. */

/** Return what a bench records of a run: time from the end of settling on, and what is kept before. */
function recordingOf({ time, table }, settle, keep) {
  const begin = time.findIndex((t) => t >= settle - keep - 1e-9);
  const since = time.slice(begin).map((t) => Math.round((t - settle) * 1e12) / 1e12);
  return { time: since, table: table.subarray(begin * (table.length / time.length)) };
}

/** Return all figures of a family by name: a number, or why there is none. */
function familyOf({ memory, room, ...functions }, { time, table }, names, family) {
  const count = time.length, columns = family.signals.map((name) => names.indexOf(name));
  const here = columns.filter((k) => k >= 0).length, figures = family.figures.length;
  const numbers = count * (1 + here + family.room) + family.setting.length + 3 * figures + 2 * columns.length;
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
  const reasons = values + 8 * figures, rows = reasons + 8 * figures;
  const places = new Uint32Array(memory.buffer, rows, 4 * columns.length).fill(0);
  starts.forEach((start, k) => (places[4 * k] = start));
  const failed = functions[family.entry](1n, BigInt(count), t, rows, setting, work, values, reasons);
  const given = new Float64Array(memory.buffer, values, figures);
  const why = new Int32Array(memory.buffer, reasons, figures);
  return family.figures.map((name, k) => {
    const reason = failed ? family.failures[failed] : family.reasons[why[k]];
    const open = !failed && family.open.includes(why[k]);
    return [name, { value: reason ? NaN : given[k], reason: reason ?? "", open }];
  });
}

/** Return all key figures of a run by name. */
const keyFigures = (exported, recording, names, families) =>
  Object.fromEntries(families.flatMap((family) => familyOf(exported, recording, names, family)));
