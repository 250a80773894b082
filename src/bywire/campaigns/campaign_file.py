"""Campaign files: TOML in, a plan out; nothing in them is executed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.faults.fault_section import require_admissible
from bywire.bench.faults.modes import Mode, modes_of
from bywire.bench.values import number, written
from bywire.campaigns.declared import CAMPAIGNS
from bywire.campaigns.judging import require_small
from bywire.campaigns.plan import (
    CampaignPlan,
    Failing,
    Reaction,
    evenly,
    read_criteria,
    touch_alike,
)
from bywire.campaigns.residual import Residual, residuals_of
from bywire.core.errors import InputError, ParameterError, quoted, unknown_name
from bywire.core.signals import signals_of
from bywire.data.file_kinds import CAMPAIGN, require_kind
from bywire.data.toml_file import read_toml
from bywire.studies.study_file import read_bench
from bywire.studies.vary_section import read_all_varied

_KEYS = (
    "name",
    "bench",
    "set",
    "vary",
    "measured",
    "campaign",
    "values",
    "criteria",
    "residuals",
    "rates",
    "reaction",
)
_SECTIONS = ("set", "vary", "campaign", "values", "rates", "reaction")
_CAMPAIGN = (
    "only",
    "leave_out",
    "present",
    "latent",
    "onset",
    "onsets",
    "spread",
    "healthy",
    "false_alarms",
    "seed",
)
_REACTION = ("fault", "value", "delay")


def read_campaign(
    source: str | Path, overrides: Mapping[str, str] = MappingProxyType({})
) -> CampaignPlan:
    """Return the campaign of a file, or that of a brake by its name.

    Parameters
    ----------
    source
        Campaign file, see ``docs/faults.md``; or the name of one that comes with a brake.
    overrides
        Further changes of the bench, as ``--set`` takes them.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit, with the file's name in front.
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
        raise type(error)(f"{file}: {error}") from None


def _plan(content: Mapping[str, Any], folder: Path, overrides: Mapping[str, str]) -> CampaignPlan:
    for key in content:
        if key not in _KEYS:
            raise unknown_name("key of a campaign file", key, _KEYS)
    for key in _SECTIONS:
        if not isinstance(content.get(key, {}), Mapping):
            raise ParameterError(f"[{key}] must be a section with key = value lines")
    bench = read_bench(content, folder, overrides)
    case = _only_case(bench)
    varied, correlations = read_all_varied(bench, content, folder)
    chosen = [v.name for v in varied if not v.unit]
    if chosen:
        raise ParameterError(f"[vary] {chosen[0]} is a choice: in a campaign only numbers vary")
    known = modes_of(case.model, case.par)
    modes = {name: mode for name, mode in known.items() if not mode.lacks(case.par)}
    _require_known_values(content.get("values", {}), modes)
    section = content.get("campaign", {})
    for key in section:
        if key not in _CAMPAIGN:
            raise unknown_name("key of [campaign]", key, _CAMPAIGN)
    singles = tuple(_failing(modes, section, content.get("values", {})))
    if not singles:
        raise ParameterError("[campaign] leaves no fault: only and leave_out contradict each other")
    latent = [
        Failing(mode, size, is_present=True)
        for name, mode in modes.items()
        if any(fnmatchcase(name, each) for each in _patterns(section, "latent", modes))
        for size in _sizes(mode, content.get("values", {}))
    ]
    pairs = _pairs(singles, latent, case)
    faults = (*singles, *pairs)
    criteria = read_criteria(content.get("criteria", []), signals_of(case.model.Output))
    if not criteria:
        raise ParameterError("[[criteria]] are missing: say what a fault must not do")
    plan = CampaignPlan(
        str(content["name"]),
        bench,
        faults,
        _onsets(section, case),
        criteria,
        _residuals(content.get("residuals"), case),
        varied,
        healthy=_whole(section, "healthy", 64, 4),
        false_alarms=_share(section),
        seed=_whole(section, "seed", 1, 0, 1_000_000),
        correlations=correlations,
        rates=_rates(content.get("rates", {}), modes),
        reaction=_reaction(content, modes),
    )
    require_small(plan)
    return plan


def _only_case(bench: Bench) -> Case:
    cases = bench.cases()
    if len(cases) != 1 or bench.faults:
        what = "has faults already" if bench.faults else f"makes {len(cases)} runs"
        raise ParameterError(
            f"the bench of a campaign makes one run without faults, but {bench.experiment!r} {what}"
        )
    return cases[0]


def _failing(
    modes: Mapping[str, Mode], section: Mapping[str, Any], values: Mapping[str, Any]
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
            raise ParameterError(f"[values] {name} takes no value: leave it out")
        if given == []:
            raise ParameterError(f"[values] {name} = []: give a value, or use leave_out")


def _sizes(mode: Mode, values: Mapping[str, Any]) -> Iterator[float]:
    """Yield the values that a mode has in the campaign [SI]."""
    given = values.get(mode.name, mode.value)
    for value in given if isinstance(given, list) else [given]:
        yield _size(mode, value, f"[values] {mode.name}")


def _size(mode: Mode, value: Any, where: str) -> float:
    """Return a value of a mode [SI]; the mode's own is a plain number."""
    if not mode.unit:
        return 0.0
    size = (
        number(value, mode.unit, where) if value is mode.value else written(value, mode.unit, where)
    )
    require_admissible(mode, size, where)
    return size


def _pairs(singles: Sequence[Failing], latent: Sequence[Failing], case: Case) -> Iterator[Failing]:
    """Yield every fault once more beside each of the latent ones, where both can be there."""
    for before in latent:
        for each in singles:
            if not touch_alike(each, before, case.par):
                yield replace(each, latent=before)


def _patterns(section: Mapping[str, Any], key: str, modes: Mapping[str, Mode]) -> list[str]:
    patterns = section.get(key, [])
    if not isinstance(patterns, list) or not all(isinstance(each, str) for each in patterns):
        raise ParameterError(f"[campaign] {key} = {quoted(patterns)}: a list of names is wanted")
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in modes):
            raise unknown_name(f"fault of [campaign] {key}", pattern, modes)
    return patterns


def _onsets(section: Mapping[str, Any], case: Case) -> tuple[float, ...]:
    first = written(section.get("onset", 0.0), "s", "[campaign] onset")
    spread = written(section.get("spread", 0.0), "s", "[campaign] spread")
    onsets = evenly(first, spread, _whole(section, "onsets", 8 if spread > 0 else 1, 1))
    if not (spread >= 0 and -case.keep <= first and onsets[-1] < case.duration):
        raise ParameterError(
            f"[campaign] onsets from {first:g} s to {onsets[-1]:g} s: they must lie between "
            f"{-case.keep:g} s and the end of the run at {case.duration:g} s"
        )
    return onsets


def _residuals(names: Any, case: Case) -> tuple[Residual, ...]:
    known = residuals_of(case.model)
    if names is None:
        return tuple(known.values())
    if not isinstance(names, list):
        raise ParameterError(f"residuals = {quoted(names)}: a list of names is wanted")
    for name in names:
        if not isinstance(name, str) or name not in known:
            raise unknown_name("residual", str(name), known)
    return tuple(known[name] for name in names)


def _whole(
    section: Mapping[str, Any], key: str, default: int, least: int, most: int = 10_000
) -> int:
    value = section.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise ParameterError(
            f"[campaign] {key} = {quoted(value)}: a whole number from {least} to {most} is wanted"
        )
    return value


def _share(section: Mapping[str, Any]) -> float:
    share = number(section.get("false_alarms", "1 %"), "1", "[campaign] false_alarms")
    if not 0 <= share < 1:
        raise ParameterError(f"[campaign] false_alarms = {share:g} must be from 0 to below 100 %")
    return share


def _rates(section: Mapping[str, Any], modes: Mapping[str, Mode]) -> dict[str, float]:
    places = {mode.place for mode in modes.values()}
    for name, rate in section.items():
        if name not in modes and name not in places:
            raise unknown_name("fault in [rates]", name, {*modes, *places})
        is_number = isinstance(rate, (int, float)) and not isinstance(rate, bool)
        if not is_number or not 0 <= rate <= 1e12:
            raise ParameterError(f"[rates] {name} = {quoted(rate)}: 0 to 1e12 is wanted")
    return {name: float(rate) for name, rate in section.items()}


def _reaction(content: Mapping[str, Any], modes: Mapping[str, Mode]) -> Reaction | None:
    section = content.get("reaction", {})
    if not section:
        return None
    for key in section:
        if key not in _REACTION:
            raise unknown_name("key of [reaction]", key, _REACTION)
    name = str(section.get("fault", ""))
    if name not in modes:
        raise unknown_name("mode of [reaction]", name, modes)
    mode = modes[name]
    if "value" in section and not mode.unit:
        raise ParameterError(f"[reaction] {name} takes no value: leave it out")
    size = section.get("value", mode.value)
    value = _size(mode, size, "[reaction] value")
    delay = written(section.get("delay", 0.0), "s", "[reaction] delay")
    if delay < 0:
        raise ParameterError(f"[reaction] delay = {delay:g} s must be >= 0 s")
    return Reaction(Failing(mode, value), delay)
