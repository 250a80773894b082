/* Columns of a measurement, each with a first plot, a unit and a use, from which the script fills in the form. */
"use strict";

const SVG = "http://www.w3.org/2000/svg", WIDE = 400, HIGH = 60;
const shortly = (value) => String(Number(value.toPrecision(4)));

/** Return the options of a select element, some in groups: [heading, [[value, text], ...]]. */
function optionsOf(groups) {
  return groups.flatMap(([heading, options]) => {
    const made = options.map(([value, text]) => element("option", text, { value }));
    if (!heading) return made;
    const group = element("optgroup", "", { label: heading });
    group.append(...made);
    return made.length ? [group] : [];
  });
}

/** Draw a column versus time, or versus its rows, with the minimum and maximum of each bin. */
function curveOf({ name, low, high }, x) {
  const svg = document.createElementNS(SVG, "svg"), path = document.createElementNS(SVG, "path");
  const set = (node, values) => Object.entries(values).forEach(([key, value]) => node.setAttribute(key, value));
  const there = [...low, ...high].filter((value) => value !== null);
  const [bottom, top] = [Math.min(...there), Math.max(...there)], [first, last] = [x[0], x.at(-1)];
  const across = (value) => (WIDE * (value - first) / (last - first || 1)).toFixed(1);
  const up = (value) => (HIGH * (1 - (top > bottom ? (value - bottom) / (top - bottom) : 0.5))).toFixed(1);
  let drawn = "", isOpen = false;
  low.forEach((value, k) => {
    if (value === null || x[k] === null) return (isOpen = false);
    drawn += `${isOpen ? "L" : "M"}${across(x[k])} ${up(value)}`;
    if (high[k] !== value) drawn += `L${across(x[k])} ${up(high[k])}`;
    isOpen = true;
  });
  set(svg, { viewBox: `0 -2 ${WIDE} ${HIGH + 4}`, preserveAspectRatio: "none", role: "img",
    "aria-label": there.length ? `${name}: ${shortly(bottom)} to ${shortly(top)}` : `${name}: no numbers` });
  set(path, { d: drawn, "vector-effect": "non-scaling-stroke" });
  svg.append(path);
  return svg;
}

/** Return the extreme values of a column as text. */
function rangeOf({ low, high }) {
  const there = [...low, ...high].filter((value) => value !== null);
  return there.length ? `${shortly(Math.min(...there))} to ${shortly(Math.max(...there))}` : "no numbers";
}

/** Show the columns in a table, and call `filled(rows)` after every choice. */
function showColumns(place, said, filled) {
  const { columns, inputs, outputs, units } = said;
  const signals = new Map([...inputs.map((each) => [`input ${each.name}`, each]),
    ...outputs.map((each) => [`output ${each.name}`, each])]);
  const named = (kind, known) => known.map(({ name, label }) => [`${kind} ${name}`, label ? `${name} (${label})` : name]);
  const uses = [["", [["", "not used"], ["time", "time"]]], ["drives the model", named("input", inputs)],
    ["compared with the model", named("output", outputs)]];
  const rows = columns.map((column) => {
    const use = element("select", "", { ariaLabel: `use of ${column.name}` });
    use.append(...optionsOf(uses));
    const unit = column.unit ? null : element("select", "", { ariaLabel: `unit of ${column.name}` });
    const wanted = column.name.toLowerCase();
    const same = [...signals].find(([, { name }]) => name.toLowerCase() === wanted);
    use.value = column.name === said.clock ? "time" : same ? same[0] : "";
    return { column, use, unit, range: element("td"), curve: element("td", "", { className: "curve" }) };
  });
  const caption = element("caption"), body = element("tbody");
  function offer({ column, use, unit }) {
    if (!unit) return;
    const symbol = use.value === "time" ? "s" : signals.get(use.value)?.symbol, chosen = unit.value;
    const groups = symbol ? [["", units[symbol].map((each) => [each, each])]]
      : Object.entries(units).map(([key, list]) => [key === "1" ? "pure number" : key, list.map((each) => [each, each])]);
    unit.replaceChildren(...optionsOf([["", [["", "choose a unit"]]], ...groups]));
    unit.value = [...unit.options].some(({ value }) => value === chosen) ? chosen : "";
    unit.required = use.value !== "";
  }
  const unitOf = ({ column, unit }) => column.unit || unit.value;
  function draw() {
    const clock = rows.find(({ use }) => use.value === "time");
    for (const row of rows) {
      const { column } = row, own = columns.find(({ name }) => name === column.clock) ?? clock?.column;
      const x = own && own.length === column.length ? own.first : [...column.low.keys(), column.low.length];
      row.range.textContent = `${rangeOf(column)} ${unitOf(row)}`.trim();
      row.curve.replaceChildren(...(column.low.length ? [curveOf(column, x)] : []));
    }
    const over = clock ? ` versus ${clock.column.name}, ${rangeOf(clock.column)} ${unitOf(clock)}`.trimEnd() : " versus its rows";
    caption.textContent = `${said.file}: each column${over}`;
  }
  function update(changed) {
    for (const row of rows) // a signal has one column
      if (changed && row !== changed && row.use.value && row.use.value === changed.use.value) row.use.value = "";
    rows.forEach(offer);
    draw();
    filled(rows.map((row) => ({ name: row.column.name, use: row.use.value, unit: row.unit ? row.unit.value : "" })), said.clock);
  }
  const headings = element("tr");
  headings.append(...["column", "use", "unit", "range", "curve"].map((text) => element("th", text, { scope: "col" })));
  const head = element("thead"), table = element("table");
  head.append(headings);
  for (const row of rows) {
    const cells = [element("th", row.column.name, { scope: "row" }), element("td"), element("td"), row.range, row.curve];
    cells[1].append(row.use);
    cells[2].append(row.unit ?? `${row.column.unit} (from the file)`);
    const line = element("tr");
    line.append(...cells);
    body.append(line);
    for (const each of [row.use, row.unit]) each?.addEventListener("change", () => update(row));
  }
  table.append(caption, head, body);
  const lacking = element("p", "Choose the use and the unit of each column that drives the model or is compared with it. "
    + "The page then fills in the fields below.", { className: "hint" });
  place.replaceChildren(lacking, table, ...said.notes.map((text) => element("p", text, { className: "hint" })));
  place.hidden = false;
  update(null);
}

/** Write the choices to the fields of the form. */
function fillIn(form, rows, usual) {
  const column = ({ name, unit }) => (unit ? `${name} [${unit}]` : name);
  const lines = (kind, isPlain) => rows.filter(({ use }) => use.startsWith(`${kind} `)).map((row) => {
    const signal = row.use.slice(kind.length + 1);
    return isPlain && column(row) === signal ? signal : `${signal}=${column(row)}`;
  }).join("\n");
  const clock = rows.find(({ use }) => use === "time");
  const isUsual = clock && !clock.unit && clock.name === usual && /^(time|t)$/i.test(usual);
  const write = (name, text) => {
    const field = form.elements[name];
    if (!field || field.value === text) return;
    field.value = text;
    field.dispatchEvent(new Event("input", { bubbles: true })); // an error next to it is outdated
  };
  write("input", lines("input", false));
  write("output", lines("output", true));
  write("time", clock && !isUsual ? column(clock) : "");
}

/** Let a form with a measurement show its columns whenever the file, the bench or the method changes. */
function armColumns(form) {
  const drop = form.querySelector(".drop"), place = form.querySelector(".columns");
  if (!drop || !form.elements.output) return;
  const select = drop.querySelector("select");
  let latest = 0;
  async function show() {
    const number = ++latest, file = select.value, valueOf = (name) => form.elements[name]?.value ?? "";
    place.hidden = true;
    place.replaceChildren();
    if (!file) return;
    const asked = new URLSearchParams({ file, bench: valueOf("bench"), method: valueOf("method") });
    try {
      const said = await ask(`/api/columns?${asked}`);
      const folded = form.elements.output.closest("details"); // which hides the fields to fill in
      if (folded) folded.open = true;
      if (number === latest) showColumns(place, said, (rows, usual) => fillIn(form, rows, usual));
    } catch (error) {
      if (number !== latest) return;
      place.replaceChildren(element("p", error.message, { className: "wrong" }));
      place.hidden = false;
    }
  }
  for (const field of [select, form.elements.bench, form.elements.method])
    if (field?.matches("select")) field.addEventListener("change", show);
}
