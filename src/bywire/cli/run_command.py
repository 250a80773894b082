"""``bywire run``."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path

from bywire.bench.bench import run
from bywire.bench.bench_file import read
from bywire.cli.progress import progress_bar
from bywire.core.errors import FileError

_STATUS = {"passed": 0, "failed": 1, "interrupted": 130}


def execute(path: Path, changes: Mapping[str, str], out: Path | None, as_text: bool) -> int:
    """Run a bench file and return the exit status."""
    from bywire.report.bench_results import as_json, kpi_rows
    from bywire.report.table_text import table_text
    from bywire.report.tables import kpi_table

    bench = read(path, changes)
    if out is not None:
        _require_folder(out)
    with warnings.catch_warnings(record=True) as caught, progress_bar() as progress:
        warnings.simplefilter("always")
        result = run(bench, progress)
    for text in [*(str(w.message) for w in caught), *result.warnings]:
        print(f"bywire: warning: {text}", file=sys.stderr)
    files = []
    if out is not None:
        from bywire.report.bench_report import write_result

        files = write_result(result, out)
    if as_text:
        print(json.dumps(as_json(result, files)))
    elif result.kpis:
        print(table_text(kpi_table(kpi_rows(result))))
    for verdict in result.verdicts:
        if not verdict.met:
            because = f" ({verdict.note})" if verdict.note else ""
            print(
                f"bywire: requirement not met: {verdict.kpi} {verdict.limit}{because}",
                file=sys.stderr,
            )
    if result.status == "interrupted":
        kept = f"; what was finished is in {out}" if out is not None else ""
        print(f"bywire: interrupted{kept}", file=sys.stderr)
    elif out is not None:
        print(f"report: {out / 'report.html'}", file=sys.stderr)
    return _STATUS[result.status]


def _require_folder(out: Path) -> None:
    """Refuse an output folder that cannot be written before anything is computed."""
    from tempfile import TemporaryFile

    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise FileError(
            f"cannot write to the output folder {out}: {error.strerror or error}; "
            "name another one with --out"
        ) from None
