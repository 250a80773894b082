"""Write docs/fault-rows.md: reference values of faults next to computed values.

``python docs/make_fault_rows.py``
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

from fault_rows import motorcycle, regeneration, wedge  # noqa: E402

TABLES: dict[str, tuple[Any, ...]] = {
    "The motorcycle brake": motorcycle.ROWS,
    "The wedge brake": wedge.ROWS,
    "The wedge brake with a motor at the wheel": regeneration.ROWS,
}
HEAD = """# Faults: reference values and computed values

The tables compare reference values for faults with values that bywire computes. The reference
values come from prototypes that use the same equations, and in some rows from earlier bywire
results. The tolerance is 10 %, 0.2 bar or 10 ms, whichever is largest. If the values disagree, the
reason is below the table. A dash means that there is no reference value.

[faults.md](faults.md) describes the faults and how to inject them. It also contains the results for
a lost wheel encoder, for which there are no reference values. `python docs/make_fault_rows.py`
computes this page, and `tests/examples/test_fault_rows.py` checks it.
"""
HEADING = ("fault", "quantity", "reference", "computed", "unit", "agrees")


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
        lines += ["", "Reasons for disagreements:", "", *apart, ""] if apart else [""]
        notes = [f"- `{row.fault}`, {row.what}: {row.note}." for row in rows if row.note]
        lines += ["Notes on other values:", "", *notes, ""] if notes else []
    return "\n".join(lines)


if __name__ == "__main__":
    (DOCS / "fault-rows.md").write_text(page(), encoding="utf-8")
