/* Tables in a notebook: a click on a heading sorts the rows, another click reverses them. */
if (!window.bywireSorts) {
  window.bywireSorts = true;
  document.addEventListener("click", ({ target }) => {
    const heading = target.closest?.(".bywire thead th");
    if (!heading) return;
    const body = heading.closest("table").tBodies[0], column = heading.cellIndex;
    const isDown = heading.getAttribute("aria-sort") === "ascending";
    const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent;
    const compare = (a, b) => a === "" || b === "" || isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b;
    const rows = [...body.rows].sort((a, b) => (isDown ? -1 : 1) * compare(key(a), key(b)));
    body.append(...rows);
    for (const each of heading.parentElement.cells) each.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", isDown ? "descending" : "ascending");
  });
}
