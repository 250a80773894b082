"""``bywire reproduce``."""

from __future__ import annotations

import json
from pathlib import Path

from bywire.cli import output
from bywire.cli.progress import progress_bar


def execute(source: str, out: Path | None, as_text: bool) -> None:
    """Reproduce a source; a known disagreement is no error."""
    from bywire.report.table_text import table_text
    from bywire.reproduction.registry import find_source
    from bywire.reproduction.results import as_json, as_table, write

    chosen = find_source(source)
    with progress_bar() as progress:
        found = chosen.reproduce(progress)
    if out is not None:
        files = write(found, out)
        output.message(f"report: {files[0]}")
    output.result(json.dumps(as_json(found)) if as_text else table_text(as_table(found)))
