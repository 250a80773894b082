"""What a design starts from: requirements, what may be chosen, a trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bywire.api.loop_case import LoopCase, spread
from bywire.bench.bench import Bench
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.data.toml_file import read_toml
from bywire.synthesis.requirement import read
from bywire.synthesis.verification import Trial

Spans = Mapping[str, tuple[float, float]]


def requirements_of(file: str | Path | None, texts: Sequence[str]) -> tuple[Limit, ...]:
    """Return the requirements of a file and of texts such as ``"bandwidth >= 10 Hz"``."""
    return read([*_from_file(None if file is None else Path(file)), *texts])


def left_to_choose(
    loop: str, spans: Spans, changes: Mapping[str, Any]
) -> dict[str, tuple[float, float]]:
    """Return what may be chosen: what the user has set stays.

    Raises
    ------
    ParameterError
        When nothing is left.
    """
    if not spans:
        raise ParameterError(f"loop {loop!r} has no gains to design")
    left = {name: span for name, span in spans.items() if name not in changes}
    if not left:
        raise ParameterError(
            f"{option('overrides')} fixes all of {', '.join(spans)}: leave out what is to be chosen"
        )
    return left


def for_ecu(
    case: LoopCase, changes: Mapping[str, Any], free: bool
) -> tuple[LoopCase, dict[str, Any], Spans]:
    """Return a case, its changes, and the spans that an ECU can run, but for what the user has set.

    What they leave one value has it in the case, and among the changes as a text with its unit.
    With ``free``, nothing is kept.
    """
    if free:
        return case, dict(changes), {}
    limits = {n: span for n, span in case.loop.realizable(case.par).items() if n not in changes}
    fixed = {name: low for name, (low, high) in limits.items() if low == high}
    units = leaf_fields(type(case.par))
    texts = {n: f"{v:.9g} {units[n].unit.symbol}".removesuffix(" 1") for n, v in fixed.items()}
    return replace(case, par=case.par.replace(fixed)), {**changes, **texts}, limits


def narrowed(spans: Spans, limits: Spans) -> Spans:
    """Return spans with the limits in their place where there are any."""
    return {name: limits.get(name, span) for name, span in spans.items()}


def tunables_of(case: LoopCase) -> Spans:
    """Return the loop's tunables; with its schedule on, those of the operating point's region."""
    schedule = case.loop.schedule
    if schedule is None or not schedule.is_on(case.par):
        return case.loop.tunables
    return schedule.regions[schedule.region(case.par, case.value)]


def trial_of(case: LoopCase, changes: Mapping[str, Any], amplitudes: str) -> Trial:
    """Return what the design is tried on; ``amplitudes`` are those of the sines, with units."""
    loop = case.loop
    sizes = spread(amplitudes, case.input_unit, "amplitudes") if amplitudes else loop.amplitudes[1:]
    bench = Bench(loop.proof, case.name, changes) if loop.proof else None
    return Trial(loop, case.par, case.value, tuple(sizes), bench)


def _from_file(path: Path | None) -> list[str]:
    """Return the requirements of a TOML file: ``figure = "<= limit"``, or a list of limits."""
    if path is None:
        return []
    section = read_toml(path, "file of requirements").get("requirements")
    if not isinstance(section, dict) or not section:
        raise ParameterError(
            f'{path}: a section [requirements] is wanted, with lines such as bandwidth = ">= 10 Hz"'
        )
    wanted = []
    for figure, limits in section.items():
        for limit in limits if isinstance(limits, list) else [limits]:
            if not isinstance(limit, str):
                raise ParameterError(f'{path}: {figure} = {limit}: write a text such as ">= 10 Hz"')
            wanted.append(f"{figure} {limit}")
    return wanted
