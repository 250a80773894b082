"""Operating points on kinks of a model: the operation, its line, and the side to use.

A minimum, a limit, a dead band or an absolute value has two derivatives where its sides meet.
There, algorithmic differentiation returns a mean of both, which is the slope of neither side.
bywire therefore compares a linear model with those next to its operating point. If they differ,
bywire lists the operations on their kinks, and uses the side that the user specifies.
"""

from __future__ import annotations

import linecache
import operator
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.smooth_functions import SmoothPoint, equations
from bywire.core import elementary, ops
from bywire.core.callers import option
from bywire.core.errors import ParameterError, quoted
from bywire.core.signals import signals_of
from bywire.core.typing import Array

ABOVE, BELOW = "above", "below"
"""side of the tested quantity: above or below its kink. The tested quantity is the first argument
of a minimum, a maximum or a comparison minus the second, or the argument of an absolute value"""
REACH = 1e-9
"""maximum distance of a kink at the operating point, relative to the signals' usual magnitudes:
operating points are solved to 1e-10 of these, so the side of a nearer kink is unknown, and smooth
functions hardly change over such a distance"""
_FINER = 1.0 / 4.0  # differences of smooth functions fall to a quarter at a quarter of the distance
_LASTING = 0.4  # remaining fraction of a difference nearby, above which a kink explains it
_SAME = 1e-6  # of an entry of a Jacobian: smaller differences need no further comparison
_SMALL = 1e-8  # likewise, of the largest entry in its row, scaled by usual magnitudes
_EQUAL = 1e-5  # of a response: models with smaller differences are equal
_ACROSS = 0.02  # of the reach: distance from a kink on both sides
_TURNS = 8
_FREQUENCIES = 40
_OPS_FILE = ops.__file__


class CornerError(ParameterError):
    """Operating point on a kink whose sides have different linear models."""


@dataclass(frozen=True)
class Sides:
    """Sides of kinks that a user specifies.

    Parameters
    ----------
    usual
        ``"above"``, ``"below"``, or empty to reject kinks.
    at
        Sides of single places, ``"FILE:LINE"``, where FILE is at least the end of the path.
    """

    usual: str = ""
    at: Mapping[str, str] = field(default_factory=dict)

    def of(self, place: str) -> str:
        """Return the side of a place; empty if none is specified."""
        for known, side in self.at.items():
            if place == known or place.endswith(f"/{known}"):
                return side
        return self.usual


def read_sides(text: str) -> Sides:
    """Return the sides in a user's text: ``"above"``, or ``"valve.py:42=below, above"``.

    Raises
    ------
    ParameterError
        When a part is neither a side nor a place with its side.
    """
    usual, places = "", {}
    for part in filter(None, (each.strip() for each in text.split(","))):
        place, equals, side = (each.strip() for each in part.rpartition("="))
        name, _, line = place.rpartition(":")
        if side not in (ABOVE, BELOW) or (equals and not (name and line.isdecimal())):
            raise ParameterError(
                f"side = {quoted(part)} is not valid: it must be 'above' or 'below', optionally "
                "for operations by file and line, for example 'valve.py:42=below, above'",
                name="side",
                value=part,
                valid="'above' or 'below'",
            )
        if equals:
            places[place.replace("\\", "/")] = side
        else:
            usual = side
    return Sides(usual, MappingProxyType(places))


_STATED: ContextVar[Sides] = ContextVar("sides", default=Sides())  # noqa: B039  # frozen


@contextmanager
def taking(side: str) -> Iterator[None]:
    """Set the side of every kink for linear models computed in this context; see `read_sides`.

    An empty text keeps the sides of the enclosing context.
    """
    if not side:
        yield
        return
    token = _STATED.set(read_sides(side))
    try:
        yield
    finally:
        _STATED.reset(token)


@dataclass(frozen=True, eq=False)
class Jacobians:
    """Jacobians of a model at one point.

    Parameters
    ----------
    slopes
        Derivatives with respect to the free signals, times their usual magnitudes, shape (rows,
        free).
    values
        Rates, outputs and new memory, shape (rows,).
    names
        Names of the rows: a state, ``NAME[k]`` of the memory; empty for an output.
    """

    slopes: Array
    values: Array
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Linearization:
    """Linear model as a function of its operating point.

    Parameters
    ----------
    point
        Operating point.
    free
        Mask of the free signals among state, memory and stimulus, in one vector.
    jacobians
        Its matrices at a point.
    models
        The linear models at a point.
    outputs, ticks
        Whether outputs, and controllers, are part of the model.
    """

    point: SmoothPoint
    free: NDArray[np.bool_]
    jacobians: Callable[[SmoothPoint], Jacobians]
    models: Callable[[SmoothPoint], tuple[LinearModel, ...]]
    outputs: bool
    ticks: bool


@dataclass(frozen=True, eq=False)
class Kink:
    """Operation near its kink.

    Parameters
    ----------
    place, source
        ``"FILE:LINE"``, and the source code there.
    excess
        Tested quantity, positive above the kink.
    slope
        Derivative of the excess with respect to the free signals, times their usual magnitudes.
    corner
        Value of both arguments at the kink.
    order
        Number in the order in which operations with a kink are computed.
    """

    place: str
    source: str
    excess: float
    slope: Array
    corner: float
    order: int

    @property
    def side(self) -> str:
        """Side of the kink on which the operation is."""
        return ABOVE if self.excess > 0.0 else BELOW


def magnitudes(point: SmoothPoint) -> Array:
    """Return the displacements of state, memory and stimulus, in one vector, divided by `REACH`.

    These are usual magnitudes, or larger values. The displacement of a sliding velocity is so small
    that its direction, which determines its side, does not change.
    """
    model = point.model
    nominal = _nominal(model.State, model.Memory, model.Stimulus)
    values = np.abs(np.concatenate([point.state, point.memory, point.stimulus]))
    usual = np.maximum(nominal, values)
    for name, direction in zip(model.frictions, point.directions, strict=True):
        if direction:
            k = model.State._fields.index(name)
            usual[k] = min(usual[k], 0.5 * values[k] / REACH)
    return np.asarray(usual)


@lru_cache(maxsize=64)
def _nominal(*kinds: type) -> tuple[float, ...]:
    """Return the usual magnitude of each signal."""
    return tuple(abs(each.nominal) for kind in kinds for each in signals_of(kind).values())


def beside_point(point: SmoothPoint, free: NDArray[np.bool_]) -> Array:
    """Return displacements of state, memory and stimulus that leave kinks, in one vector."""
    by = np.zeros(free.size)
    by[free] = REACH * _generic(int(free.sum()))[0] * magnitudes(point)[free]
    return by


def _generic(count: int) -> Array:
    """Return two random directions, along which kinks do not lie by chance, shape (2, count)."""
    rng = np.random.default_rng(20)
    return np.asarray(rng.uniform(0.5, 1.0, (2, count)) * rng.choice([-1.0, 1.0], (2, count)))


def kinks_at(
    point: SmoothPoint, free: NDArray[np.bool_], usual: Array, *, outputs: bool, ticks: bool
) -> list[Kink]:
    """Return the operations that a point's free signals can move to their kink.

    Parameters
    ----------
    point, free, outputs, ticks
        As in `Linearization`.
    usual
        See `magnitudes`.

    Returns
    -------
    list
        Operations in the order of computation; empty for equations that accept only floats.
    """
    values = np.concatenate([point.state, point.memory, point.stimulus])
    watch = _Watch()
    pairs = zip(values, np.diag(usual)[:, free], strict=True)
    numbers = [_Number(value, row, watch) for value, row in pairs]
    try:
        _evaluate(point, numbers, outputs, ticks)
    except (TypeError, ValueError, ArithmeticError, AttributeError):
        return []
    return watch.kinks


def _evaluate(point: SmoothPoint, numbers: list[Any], outputs: bool, ticks: bool) -> None:
    """Evaluate all linearized functions."""
    model, par = point.model, point.par
    n, m = point.state.size, point.memory.size
    x = cast(Any, model.State)(*numbers[:n])
    held = cast(Any, model.Memory)(*numbers[n : n + m])
    stimulus = cast(Any, model.Stimulus)(*numbers[n + m :])
    gaps = [d for group in model.gap(x, x, par) for d in group]
    contact = tuple(sum(k * d for k, d in zip(row, gaps, strict=True)) for row in point.K)
    equations(model, par, (x, held), contact, point.directions, point.moving, outputs=outputs)
    for task in model.tasks(par) if ticks else ():
        task.tick(x, held, stimulus, par)


def _size(slope: Array) -> float:
    return float(np.abs(slope).sum())


def linear_models(of: Linearization) -> tuple[LinearModel, ...]:
    """Return the linear models at an operating point, on the specified side of its kinks.

    Raises
    ------
    CornerError
        When the point lies on a kink whose sides have different models, and no side is specified.
    """
    limits = _limits_reached(of)
    if limits and _STATED.get().usual != ABOVE:
        names = ", ".join(limits)
        raise CornerError(
            f"{of.point.model.name}: at the operating point, {names} is at its lower limit and "
            "cannot decrease. Choose another operating point, or use the model for increasing "
            f"motion with {option('side', 'above')}",
            name=names,
        )
    point, slipping = on_stops(of.point, of.free)
    of = replace(of, point=point)
    corner = _Corner(of)
    models = corner.chosen() if corner.is_near() else of.models(of.point)
    texts = (*(f"above the limit of {name}" for name in limits), *slipping)
    return tuple(replace(each, corners=texts + each.corners) for each in models)


def _limits_reached(of: Linearization) -> list[str]:
    """Return the free states at their one-sided limit, 0."""
    point = of.point
    fields, usual = point.model.State._fields, magnitudes(point)
    places = {name: fields.index(name) for name in point.model.limits}
    return [name for name, k in places.items() if of.free[k] and point.state[k] <= REACH * usual[k]]


def on_stops(point: SmoothPoint, free: NDArray[np.bool_]) -> tuple[SmoothPoint, tuple[str, ...]]:
    """Return a point whose free stop operators at their widths are on the stated side.

    Returns
    -------
    tuple
        The point, and texts with the side of each of these stop operators.

    Raises
    ------
    CornerError
        When no side is stated.
    """
    side = _STATED.get().usual
    reached = _widths_reached(point, free) if point.model.stops else {}
    if not reached:
        return point, ()
    beside = point.moved(beside_point(point, free)).widths()
    kinks = [each for each, width in reached.items() if width or beside[each]]
    if kinks and not side:
        names = ", ".join(kinks)
        raise CornerError(
            f"{point.model.name}: at the operating point, {names} is at its slip limit. It slips "
            "in one direction and sticks in the other. Choose another operating point, or one "
            f"side: {option('side', 'above')} (it slips) or {option('side', 'below')} (it sticks)",
            name=names,
        )
    # Without a width, it has no effect.
    slipping = reached if side == ABOVE else reached.keys() - {*kinks}
    first, moving = len(point.model.frictions), list(point.moving)
    for each in slipping:
        moving[first + point.model.stops.index(each)] = 0.0
    how = "slips" if side == ABOVE else "sticks"
    texts = tuple(f"where {each} {how} at its limit" for each in kinks)
    return replace(point, moving=moving), texts


def _widths_reached(point: SmoothPoint, free: NDArray[np.bool_]) -> dict[str, float]:
    """Return the free stop operators at their widths, with these widths."""
    fields, usual = point.model.State._fields, magnitudes(point)
    places = {name: fields.index(name) for name in point.model.stops}
    widths = point.widths()
    return {
        name: widths[name]
        for name, k in places.items()
        if free[k] and abs(point.state[k]) >= widths[name] - REACH * usual[k]
    }


class _Corner:
    """Search for the kinks at an operating point, along directions of the free signals."""

    def __init__(self, of: Linearization) -> None:
        self.of = of
        self.usual = magnitudes(of.point)[of.free]
        generic = _generic(int(of.free.sum()))
        self.generic = [*generic, *-generic]
        self.here = np.zeros(self.usual.size)
        self.known: dict[bytes, Jacobians] = {}

    def moved(self, direction: Array) -> SmoothPoint:
        """Return the point next to the operating point."""
        by = np.zeros(self.of.free.size)
        by[self.of.free] = REACH * direction * self.usual
        return self.of.point.moved(by)

    def jacobians(self, direction: Array) -> Jacobians:
        """Return the linear model's numbers next to the operating point."""
        key = direction.tobytes()
        if key not in self.known:
            self.known[key] = self.of.jacobians(self.moved(direction))
        return self.known[key]

    def models(self, direction: Array) -> tuple[LinearModel, ...]:
        """Return the linear models next to the operating point."""
        return self.of.models(self.moved(direction))

    def is_near(self) -> bool:
        """Return whether any slope or value jumps between the point and its surroundings."""
        if not self.here.size:
            return False
        first, _, opposite, _ = self.generic
        return self.breaks(first, opposite, self.here) or self.breaks(first, self.here, self.here)

    def breaks(self, one: Array, other: Array, middle: Array) -> bool:
        """Return whether slopes differ arbitrarily close to a middle point, or values jump."""
        a, b = self.jacobians(one), self.jacobians(other)
        if not (np.isfinite(a.slopes).all() and np.isfinite(b.slopes).all()):
            return True
        if self.jumps(a, b):
            return True
        apart = np.abs(a.slopes - b.slopes)
        size = np.maximum(np.abs(a.slopes), np.abs(b.slopes))
        seen = apart > np.maximum(_SAME * size, _SMALL * size.max(axis=1, keepdims=True))
        if not seen.any():
            return False
        a, b = (self.jacobians(middle + _FINER * (each - middle)) for each in (one, other))
        return bool((np.abs(a.slopes - b.slopes) > _LASTING * apart)[seen].any())

    def differ(self, one: Array, other: Array, middle: Array) -> bool:
        """Return whether the models' responses differ arbitrarily close to a middle point."""
        pairs = [*zip(self.models(one), self.models(other), strict=True)]
        seen = [_apart(*pair) for pair in pairs]
        if not any((apart > least).any() for apart, least in seen):
            return False
        a, b = (self.models(middle + _FINER * (each - middle)) for each in (one, other))
        nearer = [_apart(*pair)[0] for pair in zip(a, b, strict=True)]
        return any(
            bool((near > _LASTING * apart)[apart > least].any())
            for near, (apart, least) in zip(nearer, seen, strict=True)
        )

    def jumps(self, a: Jacobians, b: Jacobians) -> tuple[str, ...]:
        """Return the names of the rows whose values jump between two points."""
        slopes = np.maximum(np.abs(a.slopes), np.abs(b.slopes)).sum(axis=1)
        rounding = 1e-12 * np.maximum(np.abs(a.values), np.abs(b.values))
        jump = np.abs(a.values - b.values) > 4.0 * REACH * slopes + rounding
        return tuple(a.names[k] or "an output" for k in np.flatnonzero(jump))

    def chosen(self) -> tuple[LinearModel, ...]:
        """Return the models on the specified side, or the common ones if all sides agree."""
        sides = _STATED.get()
        found: dict[str, Kink] = {}
        for direction in self.generic:
            found |= {each.place: each for each in self.kinks(direction)}
        if not found:
            return self.agreed()
        unsaid = [each for each in found.values() if not sides.of(each.place)]
        if unsaid:
            raise CornerError(self.refusal(unsaid))
        return self.taken(sides)

    def agreed(self) -> tuple[LinearModel, ...]:
        """Return the common model of all sides."""
        first, *others = self.generic
        found = self.models(first)
        finite = all(np.isfinite(model.A).all() and np.isfinite(model.D).all() for model in found)
        if not finite or any(self.differ(first, each, self.here) for each in others):
            raise CornerError(self.refusal(()))
        if not np.isfinite(self.jacobians(self.here).slopes).all():
            return found
        return found if self.differ(first, self.here, self.here) else self.models(self.here)

    def taken(self, sides: Sides) -> tuple[LinearModel, ...]:
        """Return the models on the specified sides; if they contradict, the first kinks count."""
        rows: dict[tuple[str, int], tuple[Array, float, float]] = {}
        direction = self.generic[0]
        for _ in range(_TURNS):
            kinks = self.kinks(direction)
            wrong = [each for each in kinks if each.side != sides.of(each.place)]
            if not wrong:
                break
            for each in kinks:
                sign = 1.0 if sides.of(each.place) == ABOVE else -1.0
                rows[(each.place, each.order)] = (each.slope, sign, self.offset(each, direction))
            moved = _direction([*rows.values()], self.generic[0])
            if np.array_equal(moved, direction):
                break
            direction = moved
        kinks = self.kinks(direction)
        texts = tuple(dict.fromkeys(f"{each.side} the kink of {each.place}" for each in kinks))
        return tuple(replace(model, corners=texts) for model in self.models(direction))

    def kinks(self, direction: Array) -> list[Kink]:
        """Return the operations near a direction whose kink changes the models when crossed."""
        known: dict[tuple[bytes, float], bool] = {}
        return [each for each in self.near(direction) if self._matters(each, direction, known)]

    def _matters(
        self, kink: Kink, direction: Array, known: dict[tuple[bytes, float], bool]
    ) -> bool:
        """Return `matters`, computed once for all operations that test the same quantity."""
        largest = kink.slope[np.abs(kink.slope).argmax()]
        away = round(self.offset(kink, direction) / float(largest), 6)
        key = ((kink.slope / largest).round(9).tobytes(), away)
        if key not in known:
            known[key] = self.matters(kink, direction)
        return known[key]

    def matters(self, kink: Kink, direction: Array) -> bool:
        """Return whether the two sides of an operation's kink have different models."""
        largest = np.abs(kink.slope).max()
        c = kink.slope / largest
        missing = c @ direction + self.offset(kink, direction) / largest
        along = direction - c * missing / (c @ c)  # exactly on the kink
        one, other = along + _ACROSS * c, along - _ACROSS * c
        if not self.breaks(one, other, along):
            return False
        if self.differ(one, other, along):
            return True
        jumping = self.jumps(self.jacobians(one), self.jacobians(other))
        felt = {name for model in self.models(one) for name in _felt(model)}
        return any(name in felt or name == "an output" for name in jumping)

    def near(self, direction: Array) -> list[Kink]:
        """Return the operations with a kink near the point, evaluated at a displaced point."""
        usual = magnitudes(self.of.point)
        kinks = kinks_at(
            self.moved(direction),
            self.of.free,
            usual,
            outputs=self.of.outputs,
            ticks=self.of.ticks,
        )
        return [each for each in kinks if abs(self.offset(each, direction)) <= _size(each.slope)]

    def offset(self, kink: Kink, direction: Array) -> float:
        """Return the excess at the operating point itself, relative to the reach."""
        return kink.excess / REACH - float(kink.slope @ direction)

    def refusal(self, kinks: Sequence[Kink]) -> str:
        name = self.of.point.model.name
        if not kinks:
            return (
                f"{name}: the equations have no unique finite slope at the operating point, and "
                "bywire cannot find the operation that causes this. Choose another operating point"
            )
        places = "; ".join(
            f"{each.place}, {quoted(each.source)} (kink at {each.corner:.6g}, SI)" for each in kinks
        )
        return (
            f"{name}: the operating point lies on a kink, and the linear models on both sides "
            f"differ: {places}. Choose another operating point, or one side with "
            f"{option('side', 'above')}, {option('side', 'below')}, or "
            f"{option('side', f'{kinks[0].place}=above')}"
        )


def _direction(rows: Sequence[tuple[Array, float, float]], generic: Array) -> Array:
    """Return a direction in which the excesses have the given signs, or the first of them have."""
    from scipy.optimize import linprog

    n, kept = generic.size, np.zeros((0, generic.size))
    offsets, best = np.zeros(0), generic
    for slope, sign, offset in rows:
        tried = np.vstack([kept, sign * slope / _size(slope)])
        beyond = np.append(offsets, sign * offset / _size(slope))
        limits = np.hstack([-tried, np.ones((len(tried), 1))])
        cost = np.zeros(n + 1)
        cost[-1] = -1.0
        answer = linprog(cost, limits, beyond, bounds=[(-1.0, 1.0)] * (n + 1))
        if not answer.success:
            continue
        *_, least = solution = np.asarray(answer.x)
        if least > 1e-6:
            # A small fraction of the generic direction avoids other kinks.
            best = solution[:n] + 0.3 * min(float(least), 1.0) * generic
            kept, offsets = tried, beyond
    return np.asarray(best)


def _apart(one: LinearModel, other: LinearModel) -> tuple[Array, Array]:
    """Return the difference of the responses and its tolerance; without a response, of matrices."""
    if not one.inputs or not one.outputs:
        a, b = (np.hstack([model.A, model.B]) for model in (one, other))
        return np.abs(a - b), _EQUAL * np.maximum(np.abs(a), np.abs(b))
    if one.period:
        highest = one.nyquist
        lowest = 1e-5 * highest
    else:
        rates = np.abs(np.concatenate([one.poles(), other.poles()]))
        moving = rates[(rates > 0.0) & np.isfinite(rates)] / (2.0 * np.pi)
        highest, lowest = (moving.max() * 10.0, moving.min() / 10.0) if moving.size else (1.0, 1e-3)
    f = np.geomspace(lowest, highest, _FREQUENCIES) * 0.997
    first, second = one.response(f), other.response(f)
    size = np.maximum(np.abs(first), np.abs(second))
    rounding = 1e-10 * size.max(axis=0, keepdims=True)
    return np.abs(first - second), _EQUAL * size + rounding


def _felt(model: LinearModel) -> tuple[str, ...]:
    """Return the states that influence an output; all states without outputs."""
    if not model.outputs:
        return model.states
    reached = np.asarray(model.C.any(axis=0))
    for _ in model.states:
        reached = np.asarray(reached | (model.A[reached] != 0.0).any(axis=0))
    return tuple(name for name, kept in zip(model.states, reached, strict=True) if kept)


class _Watch:
    """Operations with a kink, in the order in which they are computed."""

    def __init__(self) -> None:
        self.kinks: list[Kink] = []
        self.count = 0

    def see(self, excess: float, slope: Array, corner: float) -> None:
        """Record an operation whose kink the free signals can reach."""
        self.count += 1
        if np.isfinite(slope).all() and slope.any():
            self.kinks.append(Kink(*_place(), excess, slope, corner, self.count))


def _place() -> tuple[str, str]:
    """Return the line that computes, outside elementary functions, and its source code."""
    frame = sys._getframe(2)
    while frame.f_back and frame.f_code.co_filename in (__file__, _OPS_FILE):
        frame = frame.f_back
    name, line = frame.f_code.co_filename, frame.f_lineno
    return f"{_shown_file(name)}:{line}", linecache.getline(name, line).strip()


@lru_cache(maxsize=1024)
def _shown_file(name: str) -> str:
    path = Path(name)
    package = Path(_OPS_FILE).parents[2]
    for folder in (Path.cwd(), package):
        if path.is_relative_to(folder) and "site-packages" not in path.relative_to(folder).parts:
            path = path.relative_to(folder)
            break
    return path.as_posix()


class _Number:
    """Number with its derivatives with respect to the free signals."""

    __slots__ = ("slope", "value", "watch")
    __array_ufunc__ = None  # NumPy's scalars delegate operations to this class

    def __init__(self, value: float, slope: Array, watch: _Watch) -> None:
        self.value, self.slope, self.watch = float(value), slope, watch

    def _chain(self, value: float, factor: float) -> _Number:
        return _Number(value, factor * self.slope, self.watch)

    def __add__(self, other: Any) -> _Number:
        return _Number(self.value + _value(other), self.slope + _slope(other), self.watch)

    __radd__ = __add__

    def __sub__(self, other: Any) -> _Number:
        return _Number(self.value - _value(other), self.slope - _slope(other), self.watch)

    def __rsub__(self, other: Any) -> _Number:
        return _as_number(other, self) - self

    def __mul__(self, other: Any) -> _Number:
        b = _value(other)
        return _Number(self.value * b, b * self.slope + self.value * _slope(other), self.watch)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> _Number:
        b = _value(other)
        ratio = _divided(self.value, b)
        slope = (self.slope - ratio * _slope(other)) * _divided(1.0, b)
        return _Number(ratio, slope, self.watch)

    def __rtruediv__(self, other: Any) -> _Number:
        ratio = _divided(_value(other), self.value)
        return _Number(ratio, -ratio * _divided(1.0, self.value) * self.slope, self.watch)

    def __pow__(self, exponent: Any) -> _Number:
        if isinstance(exponent, _Number):
            return cast(_Number, ops.exp(exponent * ops.log(self)))  # type: ignore[arg-type]
        if exponent != int(exponent):
            self.watch.see(self.value, self.slope, 0.0)
        with np.errstate(all="ignore"):
            value = float(np.float64(self.value) ** exponent)
            factor = float(exponent * np.float64(self.value) ** (exponent - 1)) if exponent else 0.0
        return self._chain(value, factor)

    def __rpow__(self, base: Any) -> _Number:
        return cast(_Number, ops.exp(self * ops.log(base)))  # type: ignore[arg-type]

    def __neg__(self) -> _Number:
        return self._chain(-self.value, -1.0)

    def __pos__(self) -> _Number:
        return self

    def __abs__(self) -> _Number:
        self.watch.see(self.value, self.slope, 0.0)
        return self._chain(abs(self.value), 1.0 if self.value > 0.0 else -1.0)

    def __floordiv__(self, other: Any) -> _Number:
        return cast(_Number, self / other)._floor()

    def __mod__(self, other: Any) -> _Number:
        return cast(_Number, self - (self // other) * other)

    def __lt__(self, other: Any) -> _Choice:
        return self._compared(operator.lt, other)

    def __le__(self, other: Any) -> _Choice:
        return self._compared(operator.le, other)

    def __gt__(self, other: Any) -> _Choice:
        return self._compared(operator.gt, other)

    def __ge__(self, other: Any) -> _Choice:
        return self._compared(operator.ge, other)

    def __eq__(self, other: object) -> _Choice:  # type: ignore[override]
        return self._compared(operator.eq, other)

    def __ne__(self, other: object) -> _Choice:  # type: ignore[override]
        return self._compared(operator.ne, other)

    __hash__ = None  # type: ignore[assignment]

    def _compared(self, compare: Callable[[float, float], bool], other: Any) -> _Choice:
        self._seen_beside(other)
        return _Choice(compare(self.value, _value(other)))

    def _seen_beside(self, other: Any) -> None:
        excess, slope = self.value - _value(other), self.slope - _slope(other)
        self.watch.see(excess, slope, _value(other))

    def _floor(self) -> _Number:
        nearest = float(round(self.value))
        self.watch.see(self.value - nearest, self.slope, nearest)
        return self._chain(float(np.floor(self.value)), 0.0)

    def _bywire_op(self, name: str, *args: Any) -> Any:
        if name in ("fmin", "fmax"):
            x, y = args
            if not isinstance(x, _Number):
                x = _Number(x, np.zeros_like(self.slope), self.watch)
            x._seen_beside(y)
            return x if (x.value < _value(y)) == (name == "fmin") else _as_number(y, x)
        if name == "where":
            return args[1] if args[0] else args[2]  # a condition that is a plain number
        if name == "fabs":
            return abs(self)
        if name == "floor":
            return self._floor()
        if name == "power":
            return args[0] ** args[1]
        a = self.value
        with np.errstate(all="ignore"):
            if name == "sqrt":
                self.watch.see(a, self.slope, 0.0)
                root = float(np.sqrt(a))
                return self._chain(root, _divided(0.5, root))
            if name == "log":
                return self._chain(float(np.log(a)), _divided(1.0, a))
        if name == "exp":
            value = elementary.exp(a)
            return self._chain(value, value)
        if name == "sin":
            return self._chain(elementary.sin(a), elementary.cos(a))
        if name == "cos":
            return self._chain(elementary.cos(a), -elementary.sin(a))
        if name == "arctan":
            return self._chain(float(np.arctan(a)), 1.0 / (1.0 + a * a))
        raise TypeError(f"ops.{name} has no derivative. Define it in _Number._bywire_op")


class _Choice:
    """Result of a comparison: valid in ``ops.where``, rejected in an ``if``."""

    def __init__(self, holds: bool) -> None:
        self.holds = bool(holds)

    def __bool__(self) -> bool:
        raise TypeError("an equation must not branch on a value. Use ops.where")

    def __and__(self, other: Any) -> _Choice:
        return _Choice(self.holds and _holds(other))

    def __or__(self, other: Any) -> _Choice:
        return _Choice(self.holds or _holds(other))

    __rand__, __ror__ = __and__, __or__

    def __invert__(self) -> _Choice:
        return _Choice(not self.holds)

    def _bywire_op(self, name: str, *args: Any) -> Any:
        return args[1] if self.holds else args[2]


def _holds(value: Any) -> bool:
    return value.holds if isinstance(value, _Choice) else bool(value)


def _value(number: Any) -> float:
    return number.value if isinstance(number, _Number) else float(number)


def _slope(number: Any) -> Any:
    return number.slope if isinstance(number, _Number) else 0.0


def _as_number(value: Any, like: _Number) -> _Number:
    if isinstance(value, _Number):
        return value
    return _Number(value, np.zeros_like(like.slope), like.watch)


def _divided(a: float, b: float) -> float:
    with np.errstate(all="ignore"):
        return float(np.float64(a) / np.float64(b))
