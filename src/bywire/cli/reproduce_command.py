"""``bywire reproduce``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

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
        print(f"report: {files[0]}", file=sys.stderr)
    print(json.dumps(as_json(found)) if as_text else table_text(as_table(found)))
