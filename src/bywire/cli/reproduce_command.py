"""``bywire reproduce``."""

from __future__ import annotations

import json
from pathlib import Path

from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import FileError


def execute(source: str, out: Path | None, as_text: bool) -> None:
    """Reproduce a source; a known disagreement is no error."""
    from bywire.report.table_text import table_text
    from bywire.reproduction.registry import find_source
    from bywire.reproduction.results import as_json, as_table, write

    chosen = find_source(source)
    if out is not None:
        require_folder(out)
    with progress_bar() as progress:
        found = chosen.reproduce(progress)
    trouble: FileError | None = None
    if out is not None:
        try:
            output.message(f"report: {write(found, out)[0]}")
        except FileError as error:  # a full disk must not cost the numbers too
            trouble = error
    output.result(json.dumps(as_json(found)) if as_text else table_text(as_table(found)))
    if trouble is not None:
        raise trouble
