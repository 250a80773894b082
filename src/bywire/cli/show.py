"""What every command does with its answer: messages, the result, files, the exit status."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import BywireError

if TYPE_CHECKING:
    from bywire.bench.running import Progress
    from bywire.report.answer import Answer

INTERRUPTED = 130


def show(
    compute: Callable[[Progress], Answer], out: Path | None = None, as_json: bool = False
) -> None:
    """Compute an answer and show it; a full disk must not cost the numbers too.

    Parameters
    ----------
    compute
        ``compute(progress)``: the use case.
    out
        Folder for recordings, figures and the report; none is written without.
    as_json
        Whether one JSON object is printed.

    Raises
    ------
    BywireError
        Whatever the use case raises; what a folder could not take, after the numbers are shown.
    typer.Exit
        With status 1 where something required does not hold, and 130 after an interrupt.
    """
    if out is not None:
        require_folder(out)
    files: list[Path] = []
    trouble: BywireError | None = None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with progress_bar() as progress:
                answer = compute(progress)
            document = answer.document()
            if out is not None:
                from bywire.report.answer import write_document

                try:
                    files = write_document(document, out)
                except BywireError as error:
                    trouble = error
        except KeyboardInterrupt:  # typer would exit without a word
            output.message("interrupted")
            raise typer.Exit(INTERRUPTED) from None
    for text in dict.fromkeys([*(str(w.message) for w in caught), *answer.warnings]):
        output.message(f"warning: {text}")
    if as_json:
        from bywire.report.answer import with_files

        output.result(json.dumps(with_files(document, files)))
    elif text := str(answer):
        output.result(text)
    for remark in document.remarks:
        output.message(remark)
    if trouble is not None:
        raise trouble
    interrupted = getattr(answer, "status", "") == "interrupted"
    if interrupted:
        output.message("interrupted" + (f"; what was finished is in {out}" if out else ""))
    elif out is not None and document.is_paged:
        output.message(f"report: {out / document.page_name}")
    if interrupted or not answer.holds:
        raise typer.Exit(INTERRUPTED if interrupted else 1)
