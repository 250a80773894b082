/* A field and a slider for every parameter, in groups that open. */

/** Return an element with attributes and contents. */
function element(tag, attributes = {}, ...inside) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...inside);
  return made;
}

/** Make the row of a parameter; it calls `changed(name, value)` for every move, and `complain` for every fault of the field. */
function parameterRow(parameter, known, changed, complain) {
  const { name, shownUnit: unit, meaning, range, kind, where } = parameter;
  const slider = sliderOf(parameter), id = `p-${name}`;
  const field = element("input", { type: "text", id, autocomplete: "off",
    "aria-label": `${name}${unit && ` in ${unit}`}`, title: `valid: ${range}; a number, with or without a unit` });
  const back = element("button", { type: "button", title: "reset to the bench's value",
    "aria-label": `reset ${name} to the bench's value` }, "↺");
  const way = slider && element("input", { type: "range", min: 0, max: 1000, step: 1,
    "aria-label": `${name}, slider` });
  const source = [kind, where].filter(Boolean).join(": ");
  const row = element("div", { class: "parameter", "data-name": name },
    element("label", { for: id, title: source }, name),
    element("span", { class: "entry" }, field, element("span", { class: "unit" }, unit), back),
    element("p", { class: "meaning", title: source }, meaning));
  if (way) row.append(way);
  const show = (value) => {
    const { start } = parameter, text = digits(shownOf(value, parameter));
    field.value = text;
    if (way) way.value = Math.round(1000 * shareOf(slider, value));
    if (way) way.setAttribute("aria-valuetext", `${text} ${unit}`);
    row.classList.toggle("changed", value !== start);
    back.disabled = value === start;
    field.removeAttribute("aria-invalid");
    complain("", `field ${name}`);
  };
  const take = (value, text = "") => {
    const wrong = objection(parameter, value, text);
    if (wrong) {
      field.setAttribute("aria-invalid", "true");
      back.disabled = false;
      return complain(wrong, `field ${name}`);
    }
    show(value);
    changed(name, value);
  };
  field.addEventListener("change", () => take(quantityOf(field.value, parameter, known), field.value.trim()));
  way?.addEventListener("input", () => take(valueAt(slider, way.value / 1000)));
  back.addEventListener("click", () => take(parameter.start));
  show(parameter.start);
  return { row, show };
}

/** Fill the panel of parameters: chosen ones open at the top, the others by element below. */
function parameterPanel(place, parameters, known, chosen, changed, complain) {
  const rows = new Map(), groups = new Map();
  const above = element("div", { class: "chosen" });
  for (const parameter of parameters) {
    const made = parameterRow(parameter, known, changed, complain);
    rows.set(parameter.name, made);
    if (chosen.includes(parameter.name)) continue;
    const group = parameter.name.includes(".") ? parameter.name.split(".")[0] : "more";
    if (!groups.has(group)) groups.set(group, element("details", {}, element("summary", {}, group)));
    groups.get(group).append(made.row);
  }
  above.append(...chosen.map((name) => rows.get(name).row));
  const search = element("input", { type: "search", placeholder: "find a parameter",
    "aria-label": "find a parameter by name or meaning" });
  search.addEventListener("input", () => {
    const wanted = search.value.trim().toLowerCase();
    for (const { row } of rows.values())
      row.hidden = wanted !== "" && !row.textContent.toLowerCase().includes(wanted);
    for (const group of groups.values()) {
      const count = group.querySelectorAll(".parameter:not([hidden])").length;
      group.hidden = count === 0;
      group.open = wanted !== "" && count > 0;
    }
  });
  place.append(above, search, ...groups.values());
  return rows;
}
