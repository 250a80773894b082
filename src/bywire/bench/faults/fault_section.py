"""The section ``[[faults]]`` of a bench: which mode, how much, and when."""

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
from bywire.core.errors import ParameterError, UnknownNameError, quoted, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant, Unit
from bywire.core.typing import Array
from bywire.core.values import number, parsed

Instant = Annotated[float, Unit("s", 1.0), Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Share = Annotated[float, Unit("1", 0.5), Field(gt=0, le=1, allow_inf_nan=False)]
STAGES = 50  # in which a parameter follows a ramp
MOST = 10_000
"""times that a fault may come and go in a run"""
_EDGE = 1e-9  # s, within which an instant counts as reached


class Course(ParameterSet):
    """When a fault is there, on the recording's axis; sampled at the ticks of the controllers."""

    onset: Instant
    """when it begins; before the start of the run: it is there all along"""
    lasts: TimeConstant
    """how long it stays; 0: for good"""
    ramp: TimeConstant
    """time in which it grows to its full size, and in which it goes; 0: at once"""
    every: TimeConstant
    """interval in which it comes back; 0: it stays"""
    share: Share
    """share of that interval in which it is there"""

    @model_validator(mode="after")
    def _comes_and_goes(self) -> Course:
        if self.every > 0 and self.ramp > 0:
            raise ValueError("a fault either grows (ramp) or comes and goes (every), not both")
        if self.share < 1 and not self.every > 0:
            raise ValueError("share is that of an interval: give every, in which it comes back")
        return self

    @property
    def end(self) -> float:
        """When it begins to go [s]; infinite where it stays."""
        return self.onset + self.lasts if self.lasts > 0 else np.inf

    @property
    def gone(self) -> float:
        """From when on nothing is left of it [s]."""
        return self.end + self.ramp

    def is_there(self, t: Array) -> Array:
        """Return 1 where the fault is there, however small, else 0; of times [s]."""
        there = (t > self.onset - _EDGE) & (t < self.gone - _EDGE)
        if self.every > 0:
            phase = np.mod(t - self.onset + _EDGE, self.every)
            there &= phase < self.share * self.every
        return there.astype(float)

    def size(self, t: Array) -> Array:
        """Return the share of its full size, 0 to 1, at times [s]."""
        there = self.is_there(t)
        if not self.ramp > 0:
            return there
        with np.errstate(over="ignore"):  # of the shortest ramps: fully grown
            grown = np.clip((t - self.onset) / self.ramp, 0.0, 1.0)
            if np.isfinite(self.gone):
                grown = np.minimum(grown, np.clip((self.gone - t) / self.ramp, 0.0, 1.0))
        return there * grown

    def returns(self, first: float, last: float) -> float:
        """Return how often it comes and goes between two times [s]."""
        span = min(last, self.end) - max(first, self.onset)
        return max(span / self.every, 0.0) if self.every > 0 else 0.0

    def instants(self, first: float, last: float) -> list[float]:
        """Return when parameters change that follow it, of times [s]; ramps in stages."""
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
"""from time zero on"""


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
