"""``bywire benchmark``."""

from __future__ import annotations

import json

from bywire.cli import output
from bywire.cli.progress import progress_bar


def execute(as_text: bool) -> None:
    """Measure and print."""
    from bywire.benchmark.suite import as_json, as_table, measure
    from bywire.report.table_text import table_text

    with progress_bar() as progress:
        found = measure(progress)
    output.result(json.dumps(as_json(found)) if as_text else table_text(as_table(found)))
