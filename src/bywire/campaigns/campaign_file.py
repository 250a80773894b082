"""Reader of campaign files (TOML), which does not execute any of their content."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import Field

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.faults.fault_section import require_admissible
from bywire.bench.faults.modes import Mode, modes_of
from bywire.campaigns.judging import require_small
from bywire.campaigns.plan import (
    CampaignPlan,
    CriterionSection,
    Failing,
    Reaction,
    criteria_of,
    evenly,
    touch_alike,
)
from bywire.campaigns.residual import CAMPAIGNS, Residual, residuals_of
from bywire.core.errors import InputError, ParameterError, not_valid, quoted, unknown_name
from bywire.core.quantities import TimeConstant, Unit
from bywire.core.section import Name, Names, Section, Table
from bywire.core.signals import signals_of
from bywire.core.values import number, written
from bywire.data.toml_file import CAMPAIGN, read_toml, require_kind
from bywire.studies.study_file import BenchName, read_bench
from bywire.studies.vary_section import MeasuredSection, read_all_varied

_MOST = 10_000


class CampaignSection(Section):
    """Section ``[campaign]``: faults, their onsets, and false alarms."""

    only: Names = ()
    leave_out: Names = ()
    present: Names = ()
    latent: Names = ()
    onset: Annotated[float, Unit("s")] = 0.0
    onsets: Annotated[int | None, Field(ge=1, le=_MOST)] = None
    spread: TimeConstant = 0.0
    healthy: Annotated[int, Field(ge=4, le=_MOST)] = 64
    false_alarms: Annotated[float, Unit("1"), Field(ge=0, lt=1)] = 0.01
    seed: Annotated[int, Field(ge=0, le=1_000_000)] = 1


class ReactionSection(Section):
    """Section ``[reaction]``: reaction of the ECU to an alarm."""

    fault: str = ""
    value: Any = None
    delay: TimeConstant = 0.0


class CampaignFile(Section):
    """A campaign file."""

    name: Name
    bench: BenchName
    set: Table
    vary: Table
    measured: MeasuredSection | None = None
    campaign: CampaignSection = CampaignSection()
    values: Table
    criteria: tuple[CriterionSection, ...] = ()
    residuals: Names | None = None
    rates: Table
    reaction: ReactionSection | None = None


def read_campaign(
    source: str | Path, overrides: Mapping[str, str] = MappingProxyType({})
) -> CampaignPlan:
    """Read a campaign file, or find a brake's campaign by its name.

    Parameters
    ----------
    source
        Campaign file (see ``docs/faults.md``), or the name of a campaign that belongs to a brake.
    overrides
        Additional changes to the bench, as for ``--set``.

    Raises
    ------
    FileError
        If the file cannot be read or is not valid TOML.
    InputError
        For any invalid entry, with the file's name in front.
    """
    text = str(source)
    if text in CAMPAIGNS.all():
        return _plan({"name": text, **CAMPAIGNS.find(text).content}, Path(), overrides)
    if not text.endswith(".toml"):
        raise unknown_name("campaign", text, CAMPAIGNS.all())
    file = Path(source)
    content = read_toml(file, "campaign file")
    try:
        require_kind(content, CAMPAIGN, file)
        return _plan({"name": file.stem, **content}, file.parent, overrides)
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None


def _plan(content: Mapping[str, Any], folder: Path, overrides: Mapping[str, str]) -> CampaignPlan:
    file = CampaignFile.read(content, "a campaign file")
    section = file.campaign
    bench = read_bench(file.bench, file.set, folder, overrides)
    case = _only_case(bench)
    varied, correlations = read_all_varied(bench, file.vary, file.measured, folder)
    chosen = [v.name for v in varied if not v.unit]
    if chosen:
        raise ParameterError(
            f"[vary] {chosen[0]} is a choice, but in a campaign only numbers can vary",
            name=chosen[0],
        )
    known = modes_of(case.model, case.par)
    modes = {name: mode for name, mode in known.items() if not mode.lacks(case.par)}
    _require_known_values(file.values, modes)
    singles = tuple(_failing(modes, section, file.values))
    if not singles:
        raise ParameterError(
            "[campaign] contains no faults, because 'only' and 'leave_out' contradict each other. "
            "Change one of them",
            name="[campaign]",
        )
    latent = [
        Failing(mode, size, is_present=True)
        for name, mode in modes.items()
        if any(fnmatchcase(name, each) for each in _patterns(section, "latent", modes))
        for size in _sizes(mode, file.values)
    ]
    pairs = _pairs(singles, latent, case)
    criteria = criteria_of(file.criteria, signals_of(case.model.Output))
    if not criteria:
        raise ParameterError(
            "[[criteria]] is missing. Add a criterion for each effect that a fault must not have",
            name="criteria",
        )
    plan = CampaignPlan(
        file.name,
        bench,
        (*singles, *pairs),
        _onsets(section, case),
        criteria,
        _residuals(file.residuals, case),
        varied,
        healthy=section.healthy,
        false_alarms=section.false_alarms,
        seed=section.seed,
        correlations=correlations,
        rates=_rates(file.rates, modes),
        reaction=None if file.reaction is None else _reaction(file.reaction, modes),
    )
    require_small(plan)
    return plan


def _only_case(bench: Bench) -> Case:
    cases = bench.cases()
    if len(cases) != 1 or bench.faults:
        what = "already has faults" if bench.faults else f"has {len(cases)} runs"
        raise ParameterError(
            f"a campaign's bench must have exactly one run, without faults, but "
            f"{bench.experiment!r} {what}",
            name="bench",
            value=bench.experiment,
            valid="exactly one run",
        )
    return cases[0]


def _failing(
    modes: Mapping[str, Mode], section: CampaignSection, values: Mapping[str, Any]
) -> Iterator[Failing]:
    only, without, present = (
        _patterns(section, key, modes) for key in ("only", "leave_out", "present")
    )
    for name, mode in modes.items():
        if only and not any(fnmatchcase(name, each) for each in only):
            continue
        if any(fnmatchcase(name, each) for each in without):
            continue
        is_present = any(fnmatchcase(name, each) for each in present)
        for size in _sizes(mode, values):
            yield Failing(mode, size, is_present)


def _require_known_values(values: Mapping[str, Any], modes: Mapping[str, Mode]) -> None:
    for name, given in values.items():
        if name not in modes:
            raise unknown_name("fault in [values]", name, modes)
        if not modes[name].unit:
            raise ParameterError(
                f"[values] {name}: this fault has no value. Remove this key", name=name
            )
        if given == []:
            raise ParameterError(
                f"[values] {name} = [] is empty. Specify at least one value, or use leave_out",
                name=name,
                value="[]",
            )


def _sizes(mode: Mode, values: Mapping[str, Any]) -> Iterator[float]:
    """Yield the values of a mode in the campaign [SI]."""
    given = values.get(mode.name, mode.value)
    for value in given if isinstance(given, list) else [given]:
        yield _size(mode, value, f"[values] {mode.name}")


def _size(mode: Mode, value: Any, where: str) -> float:
    """Return a mode's value [SI]. The mode's default is a plain number."""
    if not mode.unit:
        return 0.0
    size = (
        number(value, mode.unit, where) if value is mode.value else written(value, mode.unit, where)
    )
    require_admissible(mode, size, where)
    return size


def _pairs(singles: Sequence[Failing], latent: Sequence[Failing], case: Case) -> Iterator[Failing]:
    """Yield each fault combined with each latent fault, if both can be present."""
    for before in latent:
        for each in singles:
            if not touch_alike(each, before, case.par):
                yield replace(each, latent=before)


def _patterns(section: CampaignSection, key: str, modes: Mapping[str, Mode]) -> Names:
    patterns: Names = getattr(section, key)
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in modes):
            raise unknown_name(f"fault of [campaign] {key}", pattern, modes)
    return patterns


def _onsets(section: CampaignSection, case: Case) -> tuple[float, ...]:
    first = section.onset
    onsets = evenly(first, section.spread, section.onsets or (8 if section.spread > 0 else 1))
    if not (-case.keep <= first and onsets[-1] < case.duration):
        raise ParameterError(
            f"[campaign] onsets from {first:g} s to {onsets[-1]:g} s are not valid: they must be "
            f"in the range {-case.keep:g} s to {case.duration:g} s of the run",
            name="[campaign] onsets",
            value=f"{first:g} s to {onsets[-1]:g} s",
            valid=f"{-case.keep:g} s to {case.duration:g} s",
        )
    return onsets


def _residuals(names: Names | None, case: Case) -> tuple[Residual, ...]:
    known = residuals_of(case.model)
    if names is None:
        return tuple(known.values())
    for name in names:
        if name not in known:
            raise unknown_name("residual", name, known)
    return tuple(known[name] for name in names)


def _rates(section: Mapping[str, Any], modes: Mapping[str, Mode]) -> dict[str, float]:
    places = {mode.place for mode in modes.values()}
    for name, rate in section.items():
        if name not in modes and name not in places:
            raise unknown_name("fault in [rates]", name, {*modes, *places})
        is_number = isinstance(rate, (int, float)) and not isinstance(rate, bool)
        if not is_number or not 0 <= rate <= 1e12:
            raise not_valid(f"[rates] {name}", quoted(rate), "a number from 0 to 1e12")
    return {name: float(rate) for name, rate in section.items()}


def _reaction(section: ReactionSection, modes: Mapping[str, Mode]) -> Reaction:
    if section.fault not in modes:
        raise unknown_name("mode of [reaction]", section.fault, modes)
    mode = modes[section.fault]
    if section.value is not None and not mode.unit:
        raise ParameterError(
            f"[reaction] {mode.name} has no value. Remove the key 'value'",
            name="[reaction]",
            value=mode.name,
        )
    size = mode.value if section.value is None else section.value
    return Reaction(Failing(mode, _size(mode, size, "[reaction] value")), section.delay)
