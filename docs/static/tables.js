// Long tables get a field that filters all rows of the page, and headings that sort.
const LONG = 20; // minimum number of rows for a filter field

document.addEventListener("DOMContentLoaded", () => {
  const article = document.querySelector("article.bd-article");
  const tables = [...(article?.querySelectorAll("table") ?? [])].filter(
    (table) => table.tBodies.length && table.tHead && !table.closest("dl"));
  tables.forEach(sortable);
  const rows = tables.flatMap((table) => [...table.tBodies[0].rows]);
  const longest = Math.max(0, ...tables.map((table) => table.tBodies[0].rows.length));
  if (longest >= LONG) filterable(article, tables, rows);
});

function filterable(article, tables, rows) {
  const field = document.createElement("input");
  const count = document.createElement("output");
  field.type = "search";
  field.placeholder = field.ariaLabel = "Filter the rows of this page";
  const box = document.createElement("div");
  box.className = "filter";
  box.append(field, count);
  article.querySelector("h1").after(box);
  const words = new Map(rows.map((row) => [row, row.textContent.toLowerCase()]));
  field.addEventListener("input", () => {
    const sought = field.value.toLowerCase().split(/\s+/);
    for (const row of rows) row.hidden = !sought.every((word) => words.get(row).includes(word));
    const shown = (part) => [...part.querySelectorAll("tbody tr")].filter((row) => !row.hidden);
    for (const table of tables) table.hidden = !shown(table).length;
    for (const part of article.querySelectorAll("section section"))
      part.hidden = !!field.value && !shown(part).length;
    count.textContent = field.value ? `${shown(article).length} of ${rows.length} rows` : "";
  });
}

function sortable(table) {
  [...table.tHead.rows[0].cells].forEach((cell, column) => {
    if (!cell.textContent.trim()) return;
    cell.classList.add("sortable");
    cell.tabIndex = 0;
    const sort = () => {
      const up = cell.ariaSort !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.ariaSort = null;
      cell.ariaSort = up ? "ascending" : "descending";
      const text = (row) => row.cells[column]?.textContent.trim() ?? "";
      const order = (a, b) => text(a).localeCompare(text(b), "en", { numeric: true });
      const rows = [...table.tBodies[0].rows].sort((a, b) => (up ? order(a, b) : order(b, a)));
      table.tBodies[0].append(...rows);
    };
    cell.addEventListener("click", sort);
    cell.addEventListener("keydown", (event) => event.key === "Enter" && sort());
  });
}
