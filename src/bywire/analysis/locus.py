"""Root locus: poles of a loop or plant over any parameter, and its stability limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import Loop
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array, Complex

_OUTSIDE = 1e-9  # distance from the unit circle of an unstable pole: above an integrator's rounding
_AT_REST = 1e-6  # poles this close to 1 are integrators that the loop does not move
_SLOWEST = 1e-3  # rates below it [1/s] are integrators of a continuous model
_HALVINGS = 50


@dataclass(frozen=True)
class Border:
    """Value of the parameter at which stability changes.

    Parameters
    ----------
    value
        Value of the parameter [SI].
    rate
        Crossing pole, as a rate [1/s]; for a pair, the pole with positive frequency.
    above
        Whether the loop is stable above the value; otherwise, it is stable below.
    """

    value: float
    rate: complex
    above: bool


@dataclass(frozen=True, eq=False)
class Locus:
    """Poles over the values of a parameter.

    Parameters
    ----------
    name, unit
        The parameter and its SI unit.
    values
        Its values [SI], ascending, shape (n,).
    poles
        Poles of the model, shape (n, states); each column follows one pole from value to value.
    period
        Sample time [s]; 0 for a continuous model, whose poles are rates.
    stable
        Whether the loop is stable, shape (n,).
    borders
        Values at which stability changes. A loop that becomes unstable and stable again between
        two values appears to be stable.
    """

    name: str
    unit: str
    values: Array
    poles: Complex
    period: float
    stable: NDArray[np.bool_]
    borders: tuple[Border, ...]

    @property
    def rates(self) -> Complex:
        """The poles as rates of continuous motions [1/s], shape (n, states); -inf if deadbeat."""
        if not self.period:
            return self.poles
        alive = self.poles != 0.0
        continuous = np.full(self.poles.shape, -np.inf, dtype=complex)
        continuous[alive] = np.log(self.poles[alive]) / self.period
        return continuous


def locus(
    loop: Loop, par: ParameterSet, value: float, name: str, unit: str, values: Sequence[float]
) -> Locus:
    """Return the closed loop's poles over a range of a parameter or of the operating point.

    Parameters
    ----------
    loop, par, value
        The loop and its operating point.
    name, unit
        Dotted name of a parameter, or of the loop's operating quantity, and its SI unit. For a
        gain of the controller, this is the classical root locus.
    values
        Values [SI], ascending, at least two.

    Raises
    ------
    InputError
        When an operating point does not exist, or a value is out of range.
    """

    def model(at: float) -> LinearModel:
        (case,) = loop.varied(par, value, name, [at])
        return loop.closed(*case)

    return locus_of(model, name, unit, values)


def locus_of(
    model: Callable[[float], LinearModel], name: str, unit: str, values: Sequence[float]
) -> Locus:
    """Return the poles of any family of models.

    Parameters
    ----------
    model
        ``model(value [SI]) -> LinearModel``, with the same size and sample time for all values.
    name, unit
        Varied quantity and its SI unit.
    values
        Values [SI], ascending, at least two.

    Raises
    ------
    ParameterError
        For fewer than two values.
    """
    if len(values) < 2:
        raise ParameterError(
            f"a root locus for {name} needs at least two values, but it has {len(values)}",
            name=name,
            value=str(len(values)),
            valid=">= 2 values",
        )
    models = [model(at) for at in values]
    tracked = [models[0].poles()]
    for linear in models[1:]:
        tracked.append(_followed(tracked[-1], linear.poles()))
    stable = np.array([_is_stable(linear) for linear in models])
    borders = [
        _border(model, (values[k], values[k + 1]), bool(stable[k + 1]))
        for k in map(int, np.flatnonzero(stable[1:] != stable[:-1]))
    ]
    return Locus(
        name,
        unit,
        np.asarray(values, dtype=float),
        np.array(tracked),
        models[0].period,
        stable,
        tuple(borders),
    )


def _followed(before: Complex, poles: Complex) -> Complex:
    """Return poles in the order of the previous ones, with the smallest total distance."""
    from scipy.optimize import linear_sum_assignment

    _, columns = linear_sum_assignment(np.abs(before[:, None] - poles))
    return np.asarray(poles[columns])


def _outermost(model: LinearModel) -> tuple[complex, float]:
    """Return the least stable pole as a rate [1/s], and its excess, without integrators.

    The excess is its distance outside the unit circle, or to the right of the imaginary axis.
    """
    poles = model.poles()
    if not model.period:
        moving = poles[np.abs(poles) > _SLOWEST]
        excess = moving.real
    else:
        moving = poles[(np.abs(poles - 1.0) > _AT_REST) & (poles != 0.0)]
        excess = np.abs(moving) - 1.0
    if not moving.size:
        return 0j, -np.inf
    k = int(np.argmax(excess))
    rate = np.log(moving[k]) / model.period if model.period else moving[k]
    return complex(rate.real, abs(rate.imag)), float(excess[k])


def _is_stable(model: LinearModel) -> bool:
    return _outermost(model)[1] <= _OUTSIDE


def _border(
    model: Callable[[float], LinearModel], between: tuple[float, float], above: bool
) -> Border:
    """Return the value at which stability changes between two values, by bisection."""
    # Bisection of a Boolean, because the excess of a pole jumps near z = 1, where it integrates.
    low, high = between
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _is_stable(model(middle)) == above:
            high = middle
        else:
            low = middle
    rate, _ = _outermost(model(low if above else high))  # at the unstable end
    return Border(float(0.5 * (low + high)), rate, above)
