"""Commands in this process, and what must hold of whatever they are given."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from types import FrameType
from typing import Any

import numpy as np
import typer.main

from bywire.bench.energy_ledger import actuator_ledger
from bywire.cli.main import main
from bywire.usecases import use_cases

SECONDS = 30.0
"""of a processor, that a case may take"""

LONGEST = 5000
"""characters of what is said on standard error"""


# The commands' parameters are looked up once a process, and not in every case.
typer.main.get_command = cache(typer.main.get_command)


class Hang(BaseException):
    """A case that takes too long."""


@dataclass(frozen=True)
class Verdict:
    """Exit status, what is wrong (nothing where all is well), and whether the input had defects."""

    status: int
    wrong: str
    is_sound: bool = False


@contextlib.contextmanager
def limited(seconds: float = SECONDS) -> Iterator[None]:
    """Raise Hang in what takes longer, in time of the processor."""

    def late(number: int, frame: FrameType | None) -> None:
        raise Hang(f"longer than {seconds:g} s")

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


@contextlib.contextmanager
def kept_results() -> Iterator[list[Any]]:
    """Yield a list of what benches gave since."""
    results: list[Any] = []
    case = vars(use_cases()["run"])
    run = case["function"]

    def keeping(*args: Any, **kwargs: Any) -> Any:
        results.append(run(*args, **kwargs))
        return results[-1]

    case["function"] = keeping
    try:
        yield results
    finally:
        case["function"] = run


def judged(words: Sequence[str]) -> Verdict:
    """Run a command with ``--json`` and judge what it did."""
    out, err = io.StringIO(), io.StringIO()
    argv, sys.argv = sys.argv, ["bywire", *words, *([] if "--json" in words else ["--json"])]
    status: Any = None
    try:
        with (
            limited(),
            kept_results() as results,
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            try:
                main()
            except SystemExit as ended:
                status = ended.code
    except Hang as late:
        return Verdict(-1, f"hangs: {late}")
    finally:
        sys.argv = argv
    status = 0 if status is None else status
    return Verdict(status if isinstance(status, int) else -1, _wrong(status, out, err, results))


def judged_alone(words: Sequence[str]) -> str:
    """Run a command in a process of its own too, and return what is not the same there."""
    here = judged(words)
    process = subprocess.run(
        [sys.executable, "-m", "bywire.cli", *words, "--json"],
        capture_output=True,
        text=True,
        timeout=10 * SECONDS,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    out, err = io.StringIO(process.stdout), io.StringIO(process.stderr)
    if process.returncode != here.status:
        return f"status {here.status} here, {process.returncode} in its process: {words}"
    return here.wrong or _wrong(process.returncode, out, err, [])


def _wrong(status: Any, out: io.StringIO, err: io.StringIO, results: list[Any]) -> str:
    said, shown = err.getvalue(), out.getvalue()
    if "Hang" in said:
        return "hangs"
    if "Traceback" in said or "bug in bywire" in said:
        return "traceback: " + " | ".join(said.strip().splitlines()[-4:])
    if status not in (0, 1, 2, 3):
        return f"status {status}"
    if len(said) > LONGEST:
        return f"{len(said)} characters of messages"
    if status in (2, 3) and not said.strip():
        return "an error without a word"
    if status in (0, 1) and shown.strip().startswith("{"):
        try:
            json.loads(shown, parse_constant=_refused)
        except ValueError as error:
            return f"standard output is no JSON: {error}"
    elif status in (2, 3) and shown.strip().startswith("{"):
        return "a result and an error"
    benches = [each for result in results for each in getattr(result, "results", [result])]
    return "; ".join(filter(None, (_blown_up(each, said) for each in benches)))


def _refused(text: str) -> None:
    raise ValueError(f"{text} is no JSON")


def _blown_up(result: Any, said: str) -> str:
    """Return what is not finite, or open, without a word."""
    for label, recording in getattr(result, "recordings", {}).items():
        for name, variable in recording.data_vars.items():
            if variable.dtype.kind == "f" and not np.isfinite(variable.values).all():
                return f"{label}: {name} is not finite"
        books = actuator_ledger(recording) if "time" in recording.sizes else None
        if books and books.sources and books.sinks and recording.sizes["time"]:
            is_open = abs(books.closing_error) > 1e-4 * books.turnover + 1e-9
            if is_open and "energy balance has an error" not in said:
                return f"{label}: {books.closing_error:.3g} J of {books.turnover:.3g} J are open"
    for kpi in getattr(result, "kpis", ()):
        if not np.isfinite(kpi.value) and not (kpi.note or "warning" in said):
            return f"key figure {kpi.name} = {kpi.value} without a word"
    return ""
