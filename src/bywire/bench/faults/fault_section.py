"""The section ``[[faults]]`` of a bench, read: which mode, how much, and when."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bywire.bench.faults.course import AT_ZERO, Course
from bywire.bench.faults.modes import Mode, modes_of
from bywire.bench.relative_changes import settled
from bywire.core.callers import option
from bywire.core.errors import ParameterError, UnknownNameError, quoted, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.values import number, parsed

_OWN = ("fault", "value", "seed", "set")
_RANGES = {
    "dropout": (0.0, 1.0),
    "missed": (0.0, 1.0),
    "noise": (0.0, math.inf),
    "late": (1.0, 1000.0),
    "dropped": (2.0, 1e6),
    "restarted": (1e-6, math.inf),
}


@dataclass(frozen=True)
class Injection:
    """A fault of a bench.

    Parameters
    ----------
    mode
        What fails.
    value
        How much, in SI.
    course
        When.
    seed
        Of its noise and of what it misses.
    """

    mode: Mode
    value: float
    course: Course
    seed: int = 0


def from_text(text: str) -> dict[str, Any]:
    """Return the section that a text such as ``pressure.stuck=20 bar@1.5 s`` stands for.

    Raises
    ------
    ParameterError
        When it names nothing, or a part of it is empty.
    """
    what, at, onset = (part.strip() for part in text.partition("@"))
    name, equals, value = (part.strip() for part in what.partition("="))
    if not name or (at and not onset) or (equals and not value):
        raise ParameterError(
            f"fault {quoted(text)}: write NAME, NAME=VALUE, NAME@ONSET or NAME=VALUE@ONSET, for "
            "instance 'pressure.stuck=20 bar@1.5 s'"
        )
    given = {"value": value} if equals else {}
    return {"fault": name, **given, **({"onset": onset} if at else {})}


def with_units_wanted(section: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section of a file, whose plain numbers are refused where they lack a unit."""
    return {
        key: with_units_wanted(value)
        if isinstance(value, Mapping)
        else repr(value)
        if key != "seed" and type(value) in (int, float)
        else value
        for key, value in section.items()
    }


def injections(
    sections: Sequence[Mapping[str, Any]], model: Model, par: ParameterSet
) -> tuple[Injection, ...]:
    """Return what the sections say of a model with these parameters.

    Raises
    ------
    InputError
        When a section names no fault of the model, or values that do not fit.
    """
    modes = modes_of(model, par) if sections else {}
    return tuple(_read(k, section, modes, par) for k, section in enumerate(sections))


def _read(
    k: int, section: Mapping[str, Any], modes: Mapping[str, Mode], par: ParameterSet
) -> Injection:
    where = f"faults[{k + 1}]"
    keys = (*_OWN, *AT_ZERO.flat())
    for key in section:
        if key not in keys:
            raise unknown_name(f"key in [[faults]], number {k + 1}", key, keys)
    times = {key: section[key] for key in section if key not in _OWN}
    course = AT_ZERO.replace(parsed(Course, times, f"key of {where}"))
    seed = section.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise ParameterError(f"{where}.seed = {quoted(seed)}: a whole number >= 0 is wanted")
    name = section.get("fault", "")
    if not isinstance(name, str) or not (name or "set" in section):
        raise ParameterError(
            f"{where} names no fault: write fault = \"...\" (see 'bywire list faults'), or "
            'set = {"motor.R_m" = "+50%"} for any parameter'
        )
    if "set" in section:
        return Injection(_of_parameters(where, section, par), 0.0, course, seed)
    if name not in modes:
        raise _unknown(name, modes)
    mode = modes[name]
    for choice, wanted in mode.lacks(par).items():
        raise ParameterError(
            f"fault {name}: there is nothing to fail, as {choice} = {par.value(choice)!r}: set it "
            f"to {wanted!r}, as with {option('overrides', {choice: str(wanted)})}"
        )
    return Injection(mode, _value(where, section, mode), course, seed)


def _of_parameters(where: str, section: Mapping[str, Any], par: ParameterSet) -> Mode:
    """Return the mode in which parameters are set as a section says."""
    values = section["set"]
    if not isinstance(values, Mapping) or not values or {"value", "fault"} & {*section}:
        raise ParameterError(
            f'{where}.set: write {{"motor.R_m" = "+50%"}}, and neither fault nor value beside it'
        )
    given = parsed(type(par), settled(par, values), f"parameter of {where}")
    par.replace(given)
    return Mode("changed", f"{', '.join(given)} changed", changes=lambda now, value: given)


def _value(where: str, section: Mapping[str, Any], mode: Mode) -> float:
    if not mode.unit:
        if "value" in section:
            raise ParameterError(f"{where}: {mode.name} takes no value: leave it out")
        return 0.0
    value = number(section.get("value", mode.value), mode.unit, f"{where}.value")
    require_admissible(mode, value, f"{where}.value")
    return value


def require_admissible(mode: Mode, value: float, where: str) -> None:
    """Refuse a value that a mode cannot have.

    Raises
    ------
    ParameterError
        With the range; what changes parameters is checked with these.
    """
    low, high = _RANGES.get(mode.falsified, (-math.inf, math.inf))
    is_whole = mode.falsified in ("late", "dropped")
    if not low <= value <= high or (is_whole and value % 1):
        kind = "a whole number" if is_whole else "a number"
        raise ParameterError(
            f"{where} = {value:g} of {mode.name} is not valid: {kind} from {low:g} to "
            f"{high:g} is wanted"
        )


def _unknown(name: str, modes: Mapping[str, Mode]) -> UnknownNameError:
    """Return the error of a fault that the model lacks, with the modes of the place it names."""
    place = name.rpartition(".")[0]
    here = [each for each in modes if modes[each].place == place]
    return unknown_name("fault", name, modes, first=here)
