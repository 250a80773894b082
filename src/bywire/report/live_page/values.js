/* Values of parameters: as shown and in SI, in links, files and messages. No page is needed. */

/** Return a quantity in the unit in which it is shown, and back. */
const shownOf = (value, { factor, offset }) => value * factor + offset;
const siOf = (value, { factor, offset }) => (value - offset) / factor;

/** Return a number with so many digits as a reader wants. */
const digits = (value) => String(Number(value.toPrecision(6)));

/** Return the ends of a slider [SI], and whether it goes by factors; null where it makes no sense. */
function sliderOf({ start, low, high }) {
  if (start === 0 && (low === null || high === null)) return null;
  const byFactors = start > 0 && !(low === 0 && high === 1);
  const reach = 2 * Math.abs(start);
  const [least, most] = byFactors ? [start / 4, start * 4]
    : start === 0 || (low === 0 && high === 1) ? [low, high] : [start - reach, start + reach];
  const from = Math.max(least, low ?? -Infinity), to = Math.min(most, high ?? Infinity);
  return to > from ? { from, to, byFactors } : null;
}

/** Return the value at a share of a slider's way, 0 to 1, and the share of a value. */
const valueAt = ({ from, to, byFactors }, share) =>
  byFactors ? from * (to / from) ** share : from + (to - from) * share;
const shareOf = ({ from, to, byFactors }, value) => Math.min(1, Math.max(0,
  byFactors ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from)));

/** Return why a value is not admissible, or nothing. */
function objection({ name, unit, low, high, range }, value) {
  const isWithin = typeof value === "number" && Number.isFinite(value)
    && value >= (low ?? -Infinity) && value <= (high ?? Infinity);
  if (isWithin) return "";
  return `${name} = ${value}${unit === "1" ? "" : ` ${unit}`} is not admissible: it must be ${range}`;
}

/** Return the state of the page as the part of its address behind the #. */
const linkOf = (digest, changes) =>
  new URLSearchParams([["bench", digest], ...Object.entries(changes)]).toString();

/** Return the changes that a link asks for, or throw what is wrong with it. */
function changesOf(link, digest, parameters) {
  const changes = {};
  if (!link) return changes;
  const asked = new URLSearchParams(link);
  if (asked.get("bench") !== digest)
    throw new RangeError("the link is of another bench, or of another version of this one: " +
      "its values are left out");
  asked.delete("bench");
  for (const [name, text] of asked) {
    const parameter = parameters.find((each) => each.name === name);
    if (!parameter) throw new RangeError(`the link sets '${name.slice(0, 60)}', which is no parameter here`);
    const value = text.trim() === "" ? NaN : Number(text);
    const wrong = objection(parameter, value);
    if (wrong) throw new RangeError(`the link is refused: ${wrong}`);
    changes[name] = value;
  }
  return changes;
}

/** Return a bench file with further parameters set. */
function benchFile(text, changes, parameters) {
  const lines = text.trimEnd().split("\n");
  let at = lines.indexOf("[set]");
  if (at < 0) at = lines.push("", "[set]") - 1;
  let end = at + 1;
  while (end < lines.length && lines[end] && !lines[end].startsWith("[")) ++end;
  const isChanged = (line) => Object.keys(changes).some((n) => line.startsWith(`${JSON.stringify(n)} =`));
  const kept = lines.slice(at + 1, end).filter((line) => !isChanged(line));
  const set = Object.entries(changes).map(([name, value]) => {
    const { unit } = parameters.find((each) => each.name === name);
    return `${JSON.stringify(name)} = ${unit === "1" ? value : JSON.stringify(`${value} ${unit}`)}`;
  });
  return [...lines.slice(0, at + 1), ...kept, ...set, ...lines.slice(end), ""].join("\n");
}

/** Return whether a key figure meets its requirement; a figure that is not defined does not. */
function isMet({ value }, { compare, bound }) {
  return compare === "<=" ? value <= bound : compare === ">=" ? value >= bound
    : compare === "<" ? value < bound : value > bound;
}

/** Return signals by name, each taken out of a table of rows when it is first asked for. */
function columnsOf(table, time, names) {
  const signals = {};
  names.forEach((name, k) => Object.defineProperty(signals, name, { enumerable: true, configurable: true, get() {
    const value = time.map((_, row) => table[row * names.length + k]);
    Object.defineProperty(signals, name, { value });
    return value;
  } }));
  return signals;
}

/** Return recorded signals as CSV, units in the heads, all SI. */
function csvOf(time, signals, known) {
  const heads = ["time [s]", ...known.map(({ name, unit }) => `${name} [${unit}]`)];
  const columns = [time, ...known.map(({ name }) => signals[name])];
  const rows = Array.from(time, (_, row) => columns.map((column) => column[row]).join(","));
  return [heads.join(","), ...rows, ""].join("\n");
}
