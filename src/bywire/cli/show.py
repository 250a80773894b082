"""Output of a command's answer: progress, messages, files and exit status."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated

import typer

from bywire.cli import output
from bywire.core.callers import collected_warnings
from bywire.core.errors import BywireError, FileError
from bywire.core.interrupts import interrupt_handled
from bywire.core.scratch import made_folder

if TYPE_CHECKING:
    from bywire.core.typing import Progress
    from bywire.report.answer import Answer

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON object to standard output.")]
VerboseFlag = Annotated[
    bool, typer.Option("--verbose", help="Also show definitions, explanations and all rows.")
]


# --- Progress

_INTERVAL = 0.1  # s between two updates of the bar


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Yield a function that shows a label and the completed fraction of the work."""
    if not sys.stderr.isatty():
        yield lambda label, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        auto_refresh=False,  # its thread would keep this process from forking
    )
    tasks = {}
    with bar:
        drawn = -_INTERVAL

        def show(label: str, share: float) -> None:
            nonlocal drawn
            if label not in tasks:
                tasks[label] = bar.add_task(label, total=1.0)
            now = time.monotonic()
            is_due = now - drawn >= _INTERVAL
            drawn = now if is_due else drawn
            bar.update(tasks[label], completed=share, refresh=is_due)

        yield show


# --- The folder of ``--out``


def folder(text: str) -> Path:
    """Return the path specified with ``--out``, which must not be empty.

    Raises
    ------
    FileError
        If the path is empty.
    """
    if not text.strip():
        raise FileError(
            "--out '' is empty. Specify a folder, such as '.' for the current folder",
            name="--out",
            value="''",
            valid="a folder",
        )
    return Path(text)


ANOTHER = "Choose another folder with --out"
"""advice if a folder is not writable"""


@contextmanager
def output_folder(out: Path, advice: str = ANOTHER) -> Iterator[None]:
    """Create the output folder before the computation, so that write errors appear early.

    Folders created here are removed if they stay empty. ``advice`` tells the user what to do if the
    folder is not writable.

    Raises
    ------
    FileError
        If the folder cannot be created or is not writable.
    """
    with ExitStack() as made:
        try:
            made.enter_context(made_folder(out))
            with TemporaryFile(dir=out):
                pass
        except OSError as error:
            raise FileError(
                f"cannot write to the output folder {out}: {error.strerror or error}. {advice}",
                name="--out",
                value=str(out),
            ) from None
        yield


# --- The answer


def show(
    compute: Callable[[Progress], Answer],
    out: Path | None = None,
    as_json: bool = False,
    advice: str = ANOTHER,
    verbose: bool = False,
) -> None:
    """Compute an answer and show it, and print the numbers even if the disk is full.

    Parameters
    ----------
    compute
        ``compute(progress)``: the use case.
    out
        Folder for recordings, figures and the report. If None, bywire writes no files.
    as_json
        Whether to print one JSON object.
    advice
        Advice if the folder is not writable.
    verbose
        Whether to also show definitions, explanations and all rows in a terminal.

    Raises
    ------
    BywireError
        If the use case raises it. Also, after bywire shows the numbers, if files cannot be written.
    typer.Exit
        With status 1 if a requirement is not met, and 130 after an interrupt.
    """
    from bywire.report.answer import (
        AnswerWarning,
        load_matplotlib,
        with_files,
        write_document,
    )
    from bywire.report.terminal import terminal_text, verdict_line

    if out is not None:
        load_matplotlib()
    files: list[Path] = []
    trouble: BywireError | None = None
    with collected_warnings() as caught:
        try:
            with nullcontext() if out is None else output_folder(out, advice):
                with progress_bar() as progress:
                    answer = compute(progress)
                document = answer.document()
                if out is not None:
                    try:
                        files = write_document(document, out)
                    except BywireError as error:
                        trouble = error
        except KeyboardInterrupt as stop:  # typer would exit without a message
            interrupt_handled()
            for text in (*stop.args, "interrupted"):
                output.message(str(text))
            raise typer.Exit(output.INTERRUPTED) from None
    for text in document.notices:
        output.message(text)
    others = [str(w.message) for w in caught if not issubclass(w.category, AnswerWarning)]
    for text in dict.fromkeys([*others, *answer.warnings]):
        output.message(f"warning: {text}")
    for text in (*answer.notes, *([] if out is None else document.file_notes)):
        output.message(f"note: {text}")
    if as_json:
        shown = with_files(document, files) if document.has_files else answer.as_object()
        output.result(json.dumps(shown))
    elif text := terminal_text(document, verbose):
        output.result(text)
    for remark in (*answer.failures, *document.remarks):
        output.message(remark)
    if trouble is not None:
        raise trouble
    interrupted = getattr(answer, "status", "") == "interrupted"
    if interrupted:
        kept = f". Finished results are in {out}" if out else ""
        output.message(f"interrupted{answer.partial and f': {answer.partial}'}{kept}")
    elif out is not None and document.has_files:
        written = [f"written: {path}" for path in files]
        for line in [f"report: {out / document.page_name}"] if document.is_paged else written:
            output.message(line)
    if not as_json and not interrupted and (verdict := verdict_line(document)):
        output.result(verdict)
    if interrupted or not answer.holds:
        raise typer.Exit(output.INTERRUPTED if interrupted else 1)
