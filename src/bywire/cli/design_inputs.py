"""What a design on the command line starts from: requirements, what may be chosen, a trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bywire.api.loop_case import LoopCase, spread
from bywire.bench.bench import Bench
from bywire.core.errors import ParameterError
from bywire.core.signals import signals_of
from bywire.data.toml_file import read_toml
from bywire.synthesis.requirement import Requirement, read
from bywire.synthesis.trial import Trial

Spans = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Wanted:
    """What the command line asks for, as it stands there."""

    requirements: Path | None
    require: Sequence[str]
    over: Sequence[str]
    amplitudes: str
    schedule: bool
    linear_only: bool
    seed: int


def requirements_of(wanted: Wanted) -> tuple[Requirement, ...]:
    """Return the requirements of a file and of the command line."""
    return read([*_from_file(wanted.requirements), *wanted.require])


def left_to_choose(
    loop: str, own: Spans, changes: Mapping[str, str]
) -> dict[str, tuple[float, float]]:
    """Return what may be chosen: what the user has set stays.

    Raises
    ------
    ParameterError
        When nothing is left.
    """
    if not own:
        raise ParameterError(f"loop {loop!r} has no gains to design")
    left = {name: span for name, span in own.items() if name not in changes}
    if not left:
        raise ParameterError(f"--set fixes all of {', '.join(own)}: leave out what is to be chosen")
    return left


def tunables_of(chosen: LoopCase) -> Spans:
    """Return the loop's tunables; with its schedule on, those of the operating point's region."""
    schedule = chosen.loop.schedule
    if schedule is None or not schedule.is_on(chosen.par):
        return chosen.loop.tunables
    return schedule.regions[schedule.region(chosen.par, chosen.value)]


def trial_of(chosen: LoopCase, changes: Mapping[str, str], wanted: Wanted) -> Trial | None:
    """Return what the design is tried on; None where the bench is left out."""
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
    section = read_toml(path, "file of requirements").get("requirements")
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
