"""Condense studies of the identification methods into docs/trust and docs/trust.md.

Run ``bywire identify METHOD --study 200 --out FOLDER/METHOD`` for each method (or another label),
then ``python docs/make_trust.py FOLDER``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from bywire.core.scratch import require_finished

DOCS = Path(__file__).parent
HEAD = """# Validation of the identification methods

In each study, bywire simulates experiments with sensor noise, each with its own seed. It then
identifies the parameters from starting points that are up to 30 % off. The mean of the estimates
must be within 3 standard errors of the true value. The fraction of 95 % intervals that contain the
true value must be statistically consistent with 90 to 99 %. If a row fails, the reason is below the
table. To run such a study, use `bywire identify METHOD --study COUNT`. [trust/](trust/) contains
every result with its seed.

"""
HEADING = (
    "method",
    "parameter",
    "experiments",
    "bias [standard errors]",
    "bias [%]",
    "intervals that contain the true value",
    "estimated / actual scatter",
    "holds",
)


def condensed(study: dict[str, Any], label: str) -> dict[str, Any]:
    """Return a study with one row of numbers per experiment."""
    names = list(study["recovered"])
    rows = [
        [
            experiment["seed"],
            *(f"{experiment['values'].get(name, float('nan')):.7g}" for name in names),
        ]
        for experiment in study["experiments"]
    ]
    kept = {key: study[key] for key in ("method", "parameter_set", "options", "holds", "recovered")}
    return {"label": label, **kept, "columns": ["seed", *names], "experiments": rows}


def lines(study: dict[str, Any]) -> list[str]:
    """Return the rows of the table."""
    rows = []
    for name, row in study["recovered"].items():
        bias = f"{100.0 * row['bias'] / row['truth']:+.2g}" if row["truth"] else "-"
        cells = (
            study["label"],
            name,
            row["count"],
            f"{row['bias_in_errors']:+.1f}",
            bias,
            f"{100 * row['coverage']:.1f} %",
            f"{row['claimed'] / row['scatter']:.2f}",
            "yes" if row["holds"] else "no",
        )
        rows.append("| " + " | ".join(map(str, cells)) + " |")
    return rows


def page() -> str:
    """Return the page of all studies in docs/trust."""
    table = ["| " + " | ".join(HEADING) + " |", "|---" * len(HEADING) + "|"]
    for file in sorted((DOCS / "trust").glob("*.json")):
        table += lines(json.loads(file.read_text()))
    notes = DOCS / "trust" / "notes.md"
    return HEAD + "\n".join(table) + "\n\n" + notes.read_text()


def main(folder: Path) -> None:
    """Write one file per method and the page."""
    (DOCS / "trust").mkdir(exist_ok=True)
    for file in sorted(folder.glob("*/study.json")):
        require_finished(file.parent)
        study = condensed(json.loads(file.read_text()), file.parent.name)
        text = json.dumps(study).replace('"], [', '"],\n[')
        (DOCS / "trust" / f"{study['label']}.json").write_text(text + "\n")
    (DOCS / "trust.md").write_text(page())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
