"""``bywire run``."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from pathlib import Path

from bywire.bench.bench_file import read
from bywire.bench.result import Result
from bywire.bench.running import run
from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import BywireError

_STATUS = {"passed": 0, "failed": 1, "interrupted": 130}


def execute(path: Path, changes: Mapping[str, str], out: Path | None, as_text: bool) -> int:
    """Run a bench file and return the exit status."""
    bench = read(path, changes)
    if out is not None:
        require_folder(out)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with progress_bar() as progress:
            result = run(bench, progress)
        files, trouble = _written(result, out)
    for text in dict.fromkeys([*(str(w.message) for w in caught), *result.warnings]):
        output.message(f"warning: {text}")
    _show(result, files, as_text)
    if trouble is not None:
        raise trouble
    if result.status == "interrupted":
        kept = f"; what was finished is in {out}" if out is not None else ""
        output.message(f"interrupted{kept}")
    elif out is not None:
        output.message(f"report: {out / 'report.html'}")
    return _STATUS[result.status]


def _written(result: Result, out: Path | None) -> tuple[list[Path], BywireError | None]:
    """Write the results where wanted; a full disk must not cost the numbers too."""
    if out is None:
        return [], None
    from bywire.report.bench_report import write_result

    try:
        return write_result(result, out), None
    except BywireError as error:
        return [], error


def _show(result: Result, files: list[Path], as_text: bool) -> None:
    from bywire.report.bench_results import as_json, kpi_rows
    from bywire.report.table_text import table_text
    from bywire.report.tables import kpi_table
    from bywire.report.wording import amount

    if as_text:
        output.result(json.dumps(as_json(result, files)))
    elif result.kpis:
        output.result(table_text(kpi_table(kpi_rows(result))))
    for verdict in result.verdicts:
        if not verdict.met:
            note = f" ({verdict.note})" if verdict.note else ""
            found = amount(verdict.value, verdict.unit)
            output.message(
                f"requirement not met: {verdict.kpi} is {found}, wanted {verdict.limit}{note}"
            )
