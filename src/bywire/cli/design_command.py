"""``bywire design``."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bywire.analysis.design.bench_text import bench_text
from bywire.analysis.design.designer import design
from bywire.analysis.design.linear_case import cases_of
from bywire.analysis.design.outcome import Design
from bywire.analysis.design.requirement import read
from bywire.analysis.design.verification import Trial, Verification, verify
from bywire.bench.bench import Bench
from bywire.cli import output
from bywire.cli.design_text import as_object, as_text
from bywire.cli.loop_choice import Chosen, choose, over_range, spread
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import FileError, ParameterError
from bywire.core.signals import signals_of

_LARGEST = 100_000  # bytes of a file of requirements


@dataclass(frozen=True)
class Wanted:
    """What the command line asks for, as it stands there."""

    requirements: Path | None
    require: Sequence[str]
    over: Sequence[str]
    amplitudes: str
    linear_only: bool
    seed: int


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    wanted: Wanted,
    out: Path | None,
    as_json: bool,
) -> int:
    """Choose gains for a loop and return the exit status: 1 where requirements are not met."""
    if out is not None:
        require_folder(out)
    chosen = choose(loop, parameters, at, changes)
    requirements = read([*_from_file(wanted.requirements), *wanted.require])
    tunables = _tunables(chosen, changes)
    ranges = dict(over_range(text, chosen)[::2] for text in wanted.over)
    cases = cases_of(chosen.loop, chosen.par, chosen.value, ranges)
    trial = _trial(chosen, changes, wanted)
    start = {name: chosen.par.leaves()[name] for name in tunables}
    tried: Verification | None = None
    with progress_bar() as progress:
        found = design(
            tunables, requirements, cases, start, seed=wanted.seed, progress=progress
        )  # fmt: skip
        if trial is not None and found.status == "met":
            tried = verify(
                found.gains, requirements, tunables, cases, trial, seed=wanted.seed,
                progress=progress,
            )  # fmt: skip
    files = [] if out is None else [_written(chosen, changes, found, tried, out)]
    if as_json:
        output.result(json.dumps(as_object(chosen, requirements, found, tried, files)))
    else:
        output.result(as_text(chosen, requirements, found, tried))
    for path in files:
        output.message(f"written: {path}")
    return _status(found, tried)


def _status(found: Design, tried: Verification | None) -> int:
    stopped = tried is not None and tried.tuning is not None and tried.tuning.interrupted
    if found.status == "interrupted" or stopped:
        output.message("interrupted: what is shown is the best until then")
        return 130
    if found.status == "infeasible":
        output.message("no gains meet the requirements together: see what excludes what")
        return 1
    if tried is not None and not tried.met:
        output.message("the linear requirements are met, those on the nonlinear bench are not")
        return 1
    return 0


def _tunables(chosen: Chosen, changes: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """Return what may be chosen: what the user has set stays."""
    own = chosen.loop.tunables
    if not own:
        raise ParameterError(f"loop {chosen.loop.name!r} has no gains to design")
    left = {name: span for name, span in own.items() if name not in changes}
    if not left:
        raise ParameterError(f"--set fixes all of {', '.join(own)}: leave out what is to be chosen")
    return left


def _trial(chosen: Chosen, changes: Mapping[str, str], wanted: Wanted) -> Trial | None:
    if wanted.linear_only:
        return None
    loop = chosen.loop
    model = loop.point(chosen.par, chosen.value).model
    unit = signals_of(model.Stimulus)[loop.inputs[0]].unit
    sizes = spread(wanted.amplitudes, unit, "amplitudes") if wanted.amplitudes else []
    bench = Bench(loop.proof, chosen.name, changes) if loop.proof else None
    amplitudes = tuple(sizes) or loop.amplitudes[1:]
    return Trial(loop, chosen.par, chosen.value, amplitudes, bench)


def _from_file(path: Path | None) -> list[str]:
    """Return the requirements of a TOML file: ``figure = "<= limit"``, or a list of limits."""
    if path is None:
        return []
    try:
        with path.open("rb") as stream:
            content = tomllib.loads(stream.read(_LARGEST).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"cannot read requirements {path}: {reason}") from None
    section = content.get("requirements")
    if not isinstance(section, dict) or not section:
        raise ParameterError(
            f'{path}: a section [requirements] is wanted, with lines such as bandwidth = ">= 10 Hz"'
        )
    found = []
    for figure, limits in section.items():
        for limit in limits if isinstance(limits, list) else [limits]:
            if not isinstance(limit, str):
                raise ParameterError(
                    f'{path}: {figure} = {limit}: write a text such as ">= 10 Hz"'
                )
            found.append(f"{figure} {limit}")
    return found


def _written(
    chosen: Chosen,
    changes: Mapping[str, str],
    found: Design,
    tried: Verification | None,
    out: Path,
) -> Path:
    gains = found.gains if tried is None else tried.final.gains
    state = found.status if tried is None or tried.met else "not met on the bench"
    at = chosen.loop.at
    text = bench_text(
        f"loop {chosen.loop.name} at {at.name} = {chosen.value:g} {at.unit}, requirements {state}",
        chosen.loop.proof, chosen.name, changes, chosen.par, gains,
    )  # fmt: skip
    path = out / f"{chosen.loop.name}-design.toml"
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror}") from None
    return path
