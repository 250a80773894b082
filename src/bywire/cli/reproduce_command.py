"""``bywire reproduce``."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import FileError


def execute(source: str, out: Path | None, as_json_object: bool) -> None:
    """Reproduce a source; a known disagreement is no error."""
    from bywire.reproduction.reproduction import SOURCES
    from bywire.reproduction.results import as_json, write
    from bywire.reproduction.terminal_text import terminal_text

    chosen = SOURCES.find(source)
    if out is not None:
        require_folder(out)
    with progress_bar() as progress:
        found = chosen.reproduce(progress)
    report = f"Report with notes, tolerances and figures: bywire reproduce {source} --out FOLDER"
    trouble: FileError | None = None
    if out is not None:
        try:
            report = f"report: {write(found, out)[0]}"
        except FileError as error:  # a full disk must not cost the numbers too
            trouble = error
    if as_json_object:
        output.result(json.dumps(as_json(found)))
    else:
        width = shutil.get_terminal_size().columns
        output.result(terminal_text(found, width, report))
    if trouble is not None:
        raise trouble
    if as_json_object and out is not None:
        output.message(report)
