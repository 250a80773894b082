"""Section ``[[faults]]`` of a bench: modes, values and times."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from bywire.bench.changes import settled
from bywire.bench.faults.modes import Mode, modes_of
from bywire.core.callers import option
from bywire.core.errors import (
    ParameterError,
    UnitError,
    UnknownNameError,
    not_valid,
    quoted,
    unknown_name,
)
from bywire.core.model import Model
from bywire.core.parameters import Leaf, ParameterSet
from bywire.core.quantities import TimeConstant, Unit
from bywire.core.typing import Array
from bywire.core.values import number, parsed

Instant = Annotated[float, Unit("s", 1.0), Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Share = Annotated[float, Unit("1", 0.5), Field(gt=0, le=1, allow_inf_nan=False)]
STAGES = 50  # number of steps in which a parameter follows a ramp
MOST = 10_000
"""maximum number of an intermittent fault's periods in a run"""
_EDGE = 1e-9  # s, tolerance within which a time is treated as reached


class Course(ParameterSet):
    """Times of a fault on the recording's axis, sampled at the ticks of the controllers."""

    onset: Instant
    """onset; if before the start of the run, the fault is present from the start"""
    lasts: TimeConstant
    """duration; 0: permanent"""
    ramp: TimeConstant
    """time for the fault to grow to its full size, and to disappear; 0: immediately"""
    every: TimeConstant
    """period of an intermittent fault; 0: not intermittent"""
    share: Share
    """fraction of the period ``every`` in which the fault is present"""

    @model_validator(mode="after")
    def _comes_and_goes(self) -> Course:
        if self.every > 0 and self.ramp > 0:
            raise ValueError("ramp and every contradict each other. Set only one of them")
        if self.share < 1 and not self.every > 0:
            raise ValueError("share needs the period of the fault. Also set every")
        return self

    @property
    def end(self) -> float:
        """Time at which the fault begins to disappear [s]; infinite for a permanent fault."""
        return self.onset + self.lasts if self.lasts > 0 else np.inf

    @property
    def gone(self) -> float:
        """Time from which the fault is absent [s]."""
        return self.end + self.ramp

    def is_there(self, t: Array) -> Array:
        """Return 1 at times [s] at which the fault is present, else 0."""
        there = (t > self.onset - _EDGE) & (t < self.gone - _EDGE)
        if self.every > 0:
            phase = np.mod(t - self.onset + _EDGE, self.every)
            there &= phase < self.share * self.every
        return there.astype(float)

    def size(self, t: Array) -> Array:
        """Return the fraction of its full size, 0 to 1, at times [s]."""
        there = self.is_there(t)
        if not self.ramp > 0:
            return there
        with np.errstate(over="ignore"):  # a very short ramp: full size
            grown = np.clip((t - self.onset) / self.ramp, 0.0, 1.0)
            if np.isfinite(self.gone):
                grown = np.minimum(grown, np.clip((self.gone - t) / self.ramp, 0.0, 1.0))
        return there * grown

    def returns(self, first: float, last: float) -> float:
        """Return the number of periods of the fault between two times [s]."""
        span = min(last, self.end) - max(first, self.onset)
        return max(span / self.every, 0.0) if self.every > 0 else 0.0

    def instants(self, first: float, last: float) -> list[float]:
        """Return the times [s] at which parameters change with the fault, or with its ramp."""
        ends = self.end
        if self.every > 0:
            begun = max(math.floor((first - self.onset) / self.every), 0)
            count = math.ceil(self.returns(first, last)) + 1
            pairs = (
                (self.onset + k * self.every, self.onset + (k + self.share) * self.every)
                for k in range(begun, begun + count)
            )
            return [min(t, ends) for pair in pairs if pair[0] < min(last, ends) for t in pair]
        edges = [self.onset, *([ends] if np.isfinite(ends) else [])]
        if not self.ramp > 0:
            return edges
        stages = np.arange(1, STAGES + 1) / STAGES * self.ramp
        return [float(edge + stage) for edge in edges for stage in stages]


AT_ZERO = Course(onset=0.0, lasts=0.0, ramp=0.0, every=0.0, share=1.0)
"""permanent from time zero"""


# --- The section

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
    """Fault of a bench.

    Parameters
    ----------
    mode
        Failure mode.
    value
        Its value in SI.
    course
        Its times.
    seed
        Seed of its noise and of its missed samples.
    """

    mode: Mode
    value: float
    course: Course
    seed: int = 0


def from_text(text: str) -> dict[str, Any]:
    """Return the section for a text such as ``pressure.stuck=20 bar@1.5 s``.

    Raises
    ------
    ParameterError
        When the name or another part is empty.
    """
    what, at, onset = (part.strip() for part in text.partition("@"))
    name, equals, value = (part.strip() for part in what.partition("="))
    if not name or (at and not onset) or (equals and not value):
        raise ParameterError(
            f"fault {quoted(text)} is not valid. Write NAME, NAME=VALUE, NAME@ONSET or "
            "NAME=VALUE@ONSET, for example 'pressure.stuck=20 bar@1.5 s'",
            name="fault",
            value=text,
            valid="NAME=VALUE@ONSET",
        )
    given = {"value": value} if equals else {}
    return {"fault": name, **given, **({"onset": onset} if at else {})}


def numbers_as_text(section: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section with plain numbers as texts, which are invalid where a unit is needed."""
    return {
        key: numbers_as_text(value)
        if isinstance(value, Mapping)
        else repr(value)
        if key != "seed" and type(value) in (int, float)
        else value
        for key, value in section.items()
    }


def injections(
    sections: Sequence[Mapping[str, Any]], model: Model, par: ParameterSet
) -> tuple[Injection, ...]:
    """Return the faults of a model with these parameters, from their sections.

    Raises
    ------
    InputError
        When a section contains an unknown fault, or values that are not valid.
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
            raise unknown_name(f"key of {where}", key, keys)
    times = {key: section[key] for key in section if key not in _OWN}
    try:
        course = AT_ZERO.replace(parsed(Course, times, f"key of {where}"))
    except ParameterError as error:
        raise error.reworded(f"{where}: {str(error).removeprefix('Course: ')}") from None
    seed = section.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise not_valid(f"{where}.seed", quoted(seed), "a whole number >= 0")
    name = section.get("fault", "")
    if not isinstance(name, str) or not (name or "set" in section):
        raise ParameterError(
            f"{where}.fault is missing. Write fault = \"...\" (see 'bywire list faults'), or "
            'set = {"motor.R_m" = "+50%"} for any parameter',
            name=f"{where}.fault",
        )
    if "set" in section:
        return Injection(_of_parameters(where, section, par), 0.0, course, seed)
    if name not in modes:
        raise _unknown(name, modes)
    mode = modes[name]
    for choice, wanted in mode.lacks(par).items():
        raise ParameterError(
            f"fault {name} is impossible with {choice} = {par.value(choice)!r}. Set {choice} to "
            f"{wanted!r}, for example {option('overrides', {choice: str(wanted)})}",
            name=choice,
            value=repr(par.value(choice)),
            valid=repr(wanted),
        )
    return Injection(mode, _value(where, section, mode), course, seed)


def _of_parameters(where: str, section: Mapping[str, Any], par: ParameterSet) -> Mode:
    """Return the mode that sets the parameters of a section."""
    values = section["set"]
    if not isinstance(values, Mapping) or not values or {"value", "fault"} & {*section}:
        raise ParameterError(
            f'{where}.set is not valid. Write set = {{"motor.R_m" = "+50%"}}, without the keys '
            "fault and value",
            name=f"{where}.set",
            valid='{"motor.R_m" = "+50%"}',
        )
    given = parsed(type(par), settled(par, values), f"parameter of {where}")
    par.replace(given)
    return Mode("changed", f"{', '.join(given)} changed", changes=lambda now, value: given)


def _value(where: str, section: Mapping[str, Any], mode: Mode) -> float:
    if not mode.unit:
        if "value" in section:
            raise ParameterError(
                f"{where}.value = {quoted(section['value'])} is not valid: fault {mode.name} has "
                "no value. Leave it out",
                name=f"{where}.value",
                value=quoted(section["value"]),
            )
        return 0.0
    given = section.get("value", mode.value)
    try:
        value = number(given, mode.unit, f"{where}.value")
    except UnitError as error:
        if not _is_time(given):
            raise
        onset = f"{mode.name}@{given}"
        raise error.reworded(
            f"{error}. For a fault that starts at this time, write --fault {quoted(onset)}"
        ) from None
    text = given if isinstance(given, str) else ""
    require_admissible(mode, value, f"{where}.value", text)
    return value


def _is_time(given: object) -> bool:
    try:
        number(given, "s", "")
    except (UnitError, TypeError, ValueError):
        return False
    return isinstance(given, str)


def require_admissible(mode: Mode, value: float, where: str, text: str = "") -> None:
    """Reject a value outside the range of a mode; errors use the unit of its text.

    Raises
    ------
    ParameterError
        With the range. The parameters themselves check the values of modes that change them.
    """
    low, high = _RANGES.get(mode.corrupted, (-math.inf, math.inf))
    is_whole = mode.corrupted in ("late", "dropped")
    if not low <= value <= high or (is_whole and value % 1):
        leaf = Leaf(where, Unit(mode.unit), low, high, low_open=False, high_open=False)
        written, valid = leaf.outside_text(value, text)
        kind = "a whole number " if is_whole else ""
        raise not_valid(where, written, f"{kind}{valid} for fault {mode.name}")


def _unknown(name: str, modes: Mapping[str, Mode]) -> UnknownNameError:
    """Return the error for an unknown fault, with the modes of the same place."""
    place = name.rpartition(".")[0]
    here = [each for each in modes if modes[each].place == place]
    return unknown_name("fault", name, modes, first=here)
