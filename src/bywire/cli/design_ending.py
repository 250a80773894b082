"""How a design on the command line ends: a bench file, a message, an exit status."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from bywire.analysis.design.bench_text import bench_text
from bywire.analysis.design.outcome import Status
from bywire.analysis.design.verification import Verification
from bywire.cli import output
from bywire.cli.loop_choice import Chosen
from bywire.core.errors import FileError


def written(
    chosen: Chosen,
    changes: Mapping[str, str],
    gains: Mapping[str, float],
    outcome: tuple[Status, Verification | None],
    points: str,
    out: Path,
) -> Path:
    """Write the gains as a bench file, and return its path.

    Parameters
    ----------
    outcome
        Status of the linear design, and what the bench said.
    points
        Operating points, in words.

    Raises
    ------
    FileError
        When it cannot be written.
    """
    status, tried = outcome
    state = status if tried is None or tried.met else "not met on the bench"
    text = bench_text(
        f"loop {chosen.loop.name} at {chosen.loop.at.name} = {points}, requirements {state}",
        chosen.loop.proof, chosen.name, changes, chosen.par, gains,
    )  # fmt: skip
    path = out / f"{chosen.loop.name}-design.toml"
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror}") from None
    return path


def exit_status(status: Status, tried: Verification | None) -> int:
    """Say what became of the requirements, and return the exit status."""
    stopped = tried is not None and tried.tuning is not None and tried.tuning.interrupted
    if status == "interrupted" or stopped:
        output.message("interrupted: what is shown is the best until then")
        return 130
    if status == "infeasible":
        output.message("no gains meet the requirements together: see what excludes what")
        return 1
    if tried is not None and not tried.met:
        output.message("the linear requirements are met, those on the nonlinear bench are not")
        return 1
    return 0
