"""Write docs/fault-rows.md: every fault row of the specification, and what our benches give.

``python docs/make_fault_rows.py``
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

from fault_rows import motorcycle, wedge  # noqa: E402

TABLES: dict[str, tuple[Any, ...]] = {
    "The motorcycle brake": motorcycle.ROWS,
    "The wedge brake": wedge.ROWS,
}
HEAD = """# Faults: what was stated, and what bywire gives

Stated are figures of prototypes of the same equations; some were bywire's own once, and those rows
show that nothing has changed. Admitted are 10 %, 0.2 bar or
10 ms, whichever is larger; what does not agree is left standing, with its reason. Computed by
`python docs/make_fault_rows.py` and, as a test, by `tests/examples/test_fault_rows.py`; what the
faults are and how to inject them says [faults.md](faults.md). A dash stands where no figure is
stated; that of a wheel's lost encoder, of which none is stated either, is there.
"""
HEADING = ("fault", "figure", "stated", "computed", "unit", "agrees")


def page() -> str:
    """Return the page, with every row computed."""
    lines = [HEAD]
    for title, rows in TABLES.items():
        values = [row.computed() for row in rows]
        lines += [f"## {title}", "", "| " + " | ".join(HEADING) + " |", "|---" * 6 + "|"]
        cells = (row.cells(v) for row, v in zip(rows, values, strict=True))
        lines += ["| " + " | ".join(row) + " |" for row in cells]
        apart = dict.fromkeys(
            f"- `{row.fault}`, {row.what}: {row.because}."
            for row, v in zip(rows, values, strict=True)
            if not row.agrees(v)
        )
        lines += ["", "Why some do not agree:", "", *apart, ""] if apart else [""]
        notes = [f"- `{row.fault}`, {row.what}: {row.note}." for row in rows if row.note]
        lines += ["What explains others:", "", *notes, ""] if notes else []
    return "\n".join(lines)


if __name__ == "__main__":
    (DOCS / "fault-rows.md").write_text(page(), encoding="utf-8")
