/* Parameter values: as shown and in SI, in links, files and messages. They need no page. */

/** Return a quantity in the unit in which it is shown, and back. */
const shownOf = (value, { factor, offset }) => value * factor + offset;
const siOf = (value, { factor, offset }) => (value - offset) / factor;

/** Return a number with as many digits as a reader needs. */
const digits = (value) => String(Number(value.toPrecision(6)));

/** Return a number in four digits with its unit. */
const withUnit = (value, unit) => `${Number(value.toPrecision(4))} ${unit}`.trim();

/** Return a key figure [SI] in the unit for its size; `sizes`: least size, factor and unit of each. */
function readable(value, { sizes, unit, factor, offset }) {
  const fitting = value && sizes.findLast(([least]) => Math.abs(value) * (1 + 1e-6) >= least);
  return fitting ? withUnit(value * fitting[1], fitting[2]) : withUnit(shownOf(value, { factor, offset }), unit);
}

/** Return a value at the pointer with its unit, or the name of a level. */
function reading(value, unit, levels = []) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  return levels.length ? levels[value] ?? String(value) : withUnit(value, unit);
}

/** Return the ends of a slider [SI], and whether it moves by factors; null if a slider makes no sense. */
function sliderOf({ start, low, high }) {
  if (start === 0 && (low === null || high === null)) return null;
  const byFactors = start > 0 && !(low === 0 && high === 1);
  const reach = 2 * Math.abs(start);
  const [least, most] = byFactors ? [start / 4, start * 4]
    : start === 0 || (low === 0 && high === 1) ? [low, high] : [start - reach, start + reach];
  const from = Math.max(least, low ?? -Infinity), to = Math.min(most, high ?? Infinity);
  return to > from ? { from, to, byFactors } : null;
}

/** Return the value at a fraction of a slider's travel, 0 to 1, and the fraction of a value. */
const valueAt = ({ from, to, byFactors }, share) =>
  byFactors ? from * (to / from) ** share : from + (to - from) * share;
const shareOf = ({ from, to, byFactors }, value) => Math.min(1, Math.max(0,
  byFactors ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from)));

/** Return why a value is not valid, or an empty text; `text`: the typed text if it is not a number in the unit. */
function objection({ name, unit, shownUnit, low, high, range }, value, text = "") {
  const isWithin = typeof value === "number" && Number.isFinite(value)
    && value >= (low ?? -Infinity) && value <= (high ?? Infinity);
  if (isWithin) return "";
  if (Number.isFinite(value)) return `${name} must be ${range}, not ${value}${unit === "1" ? "" : ` ${unit}`}`;
  const typed = text.length > 40 ? `"${text.slice(0, 40)} …"` : text ? `"${text}"` : "empty";
  return `${name} must be ${range}, not ${typed}. Type a number${shownUnit ? ` in ${shownUnit}, or with a unit` : ""}`;
}

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const TOKEN = /\s*(?:([A-Za-zµμΩ%°]+(?:_[A-Za-z]+)?)(?:(?:\*\*|\^)?(-?\d)(?![\d.])|(⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]))?|([*·/()])|1(?=\s*\/))/y;

/** Return factor and exponents of base units of a unit, a product or quotient of those known; null of any other text. */
function unitOf(text, known) {
  let at = 0;
  const one = known[0][2].map(() => 0);
  if (text === "1") return { factor: 1, powers: one };
  const next = () => {
    TOKEN.lastIndex = at;
    const found = TOKEN.exec(text);
    if (!found) return null;
    at = TOKEN.lastIndex;
    return found;
  };
  const raised = ({ factor, powers }, n) => ({ factor: factor ** n, powers: powers.map((p) => n * p) });
  const product = () => {
    let whole = { factor: 1, powers: one }, by = 1, isOpen = true;
    for (let start = at, found = next(); found; start = at, found = next()) {
      const [, name, plain, high, sign] = found;
      if (sign === ")") return isOpen ? null : ((at = start), whole);
      if (sign === "/" || sign === "*" || sign === "·") {
        if (isOpen && !(sign === "/" && at === found[0].length)) return null;
        by = sign === "/" ? -1 : 1;
        isOpen = true;
        continue;
      }
      if (!name && !sign) { isOpen = false; continue; } // the 1 of 1/s
      let part = null;
      if (sign === "(") {
        part = product();
        if (!part || next()?.[4] !== ")") return null;
      } else {
        const row = known.find(([each]) => each === name);
        const n = plain ? Number(plain) : high ? Number([...high].map((c) => (c === "⁻" ? "-" : RAISED.indexOf(c))).join("")) : 1;
        if (row) part = raised({ factor: row[1], powers: row[2] }, n);
      }
      if (!part) return null;
      const { factor, powers } = raised(part, by);
      whole = { factor: whole.factor * factor, powers: whole.powers.map((p, k) => p + powers[k]) };
      by = 1;
      isOpen = false;
    }
    return isOpen ? null : whole;
  };
  const whole = product();
  return whole && text.slice(at).trim() === "" ? whole : null;
}

const NUMBER = /^\s*([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*$/s;

/** Return a text as a value [SI]: a number in the unit shown, or one with a unit; NaN of any other text. */
function quantityOf(text, parameter, known) {
  const found = text.length <= 100 ? NUMBER.exec(text) : null;
  if (!found) return NaN;
  const number = Number(found[1].replace(",", ".")), rounded = (value) => Number(value.toPrecision(15));
  if (!found[2]) return rounded(siOf(number, parameter));
  const shift = parameter.shifted?.[found[2]]; // a temperature with a zero of its own
  if (shift) return rounded(number * shift[0] + shift[1]);
  const [unit, wanted] = [unitOf(found[2], known), unitOf(parameter.unit.replaceAll("delta_degC", "K"), known)];
  const last = parameter.turns ? 0 : 1; // whether a radian is more than a pure number here
  const isAlike = unit && wanted && unit.powers.slice(0, unit.powers.length - last)
    .every((power, k) => power === wanted.powers[k]);
  return isAlike ? rounded(number * (unit.factor / wanted.factor)) : NaN;
}

/** Return the state of the page as the part of its address behind the #. */
const linkOf = (digest, changes) =>
  new URLSearchParams([["bench", digest], ...Object.entries(changes)]).toString();

/** Return the changes that a link sets; throw a RangeError for an invalid link. */
function changesOf(link, digest, parameters) {
  const changes = {};
  if (!link) return changes;
  const asked = new URLSearchParams(link);
  if (asked.get("bench") !== digest)
    throw new RangeError("this link belongs to another bench or version. " +
      "The page ignores its values");
  asked.delete("bench");
  for (const [name, text] of asked) {
    const parameter = parameters.find((each) => each.name === name);
    if (!parameter) throw new RangeError(`the link sets '${name.slice(0, 60)}', which is not a parameter of this page`);
    const value = text.trim() === "" ? NaN : Number(text);
    const wrong = objection(parameter, value, text.trim());
    if (wrong) throw new RangeError(`the link is not valid: ${wrong}`);
    changes[name] = value;
  }
  return changes;
}

/** Return a bench file with additional parameters set. */
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

/** Return signals by name, each read from a table of rows on first use. */
function columnsOf(table, time, names) {
  const signals = {};
  names.forEach((name, k) => Object.defineProperty(signals, name, { enumerable: true, configurable: true, get() {
    const value = time.map((_, row) => table[row * names.length + k]);
    Object.defineProperty(signals, name, { value });
    return value;
  } }));
  return signals;
}

/** Return recorded signals as CSV in SI, with units in the headings. */
function csvOf(time, signals, known) {
  const heads = ["time [s]", ...known.map(({ name, unit }) => `${name} [${unit}]`)];
  const columns = [time, ...known.map(({ name }) => signals[name])];
  const rows = Array.from(time, (_, row) => columns.map((column) => column[row]).join(","));
  return [heads.join(","), ...rows, ""].join("\n");
}
