"""How a design on the command line ends: a bench file, a message, an exit status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.api.loop_case import LoopCase
from bywire.cli import output
from bywire.core.errors import FileError
from bywire.synthesis.bench_text import bench_text
from bywire.synthesis.outcome import Status
from bywire.synthesis.requirement import Requirement
from bywire.synthesis.verification import Verification

if TYPE_CHECKING:
    from bywire.cli.verification_text import Part
    from bywire.report.design_curves import DesignCurve

_STEPS, _SETTLED = 5.0, 1.2  # what is drawn of a step: periods of the bandwidth, settling times


def written(
    chosen: LoopCase,
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


def reported(
    chosen: LoopCase,
    requirements: Sequence[Requirement],
    outcome: tuple[Status, Verification | None],
    designs: Mapping[str, Mapping[str, float]],
    parts: Sequence[Part],
    out: Path,
) -> list[Path]:
    """Write figures and page of a design, and return the files.

    Parameters
    ----------
    outcome
        See `written`.
    designs
        Gains by what they are called, the retuned ones of the bench not among them.
    parts
        Tables and sentences of the result.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    from bywire.report.design_report import Outcome, write_design

    status, tried = outcome
    every = {"as given": {}, **designs}
    if tried is not None and tried.tuning is not None:
        every["retuned on the bench"] = tried.final.gains
    curves = [_curve(chosen, label, gains) for label, gains in every.items()]
    state = status if status != "met" or tried is None or tried.met else "not met"
    where = "on the linear model" if tried is None else "on the nonlinear bench"
    told = Outcome(f"requirements {state} {where}", status == state == "met")
    return write_design(out, chosen.subject, requirements, told, curves, parts)


def _curve(chosen: LoopCase, label: str, gains: Mapping[str, float]) -> DesignCurve:
    from bywire.analysis.loop_curves import loop_curve
    from bywire.analysis.margins import figures_at
    from bywire.report.design_curves import DesignCurve

    figures = figures_at(chosen.loop, chosen.par.replace(gains), chosen.value)
    step: NDArray[np.float64] = np.zeros(1)
    span = 0.0
    if figures.is_stable:
        step, settling = figures.step, figures.settling_time
        span = max(_STEPS / figures.bandwidth, _SETTLED * settling if settling < np.inf else 0.0)
    time = np.arange(step.size, dtype=float) * figures.closed.period
    return DesignCurve(label, loop_curve(chosen.loop, figures), time, step, span)


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
