"""Elementary functions that dispatch on the type of their argument.

The equations of plant and control call only these functions. So the same equation works with
floats, NumPy arrays, CasADi symbols and any object that has its own operations (a method
``_bywire_op``, such as the quantities of the dimension tests). Floats do not need CasADi. For a
float, exponential, logarithm, power, sine and cosine are bit-identical to kernels and exported ECU
code. For an array, they come from NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bywire.core import elementary, elementary_single

_FLOATS: dict[str, Callable[..., Any]] = {
    "exp": elementary.exp,
    "log": elementary.log,
    "sqrt": math.sqrt,
    "sin": elementary.sin,
    "cos": elementary.cos,
    "arctan": math.atan,
    "fabs": abs,
    "floor": math.floor,
    "fmax": max,
    "fmin": min,
    "power": elementary.power,
}
_SINGLES: dict[str, Callable[..., Any]] = {
    "exp": elementary_single.exp,
    "sin": elementary_single.sin,
    "cos": elementary_single.cos,
    # For 0.0 and -0.0, return the first, like the float version. NumPy may return either.
    "fmax": lambda x, y: max(np.float32(x), np.float32(y)),
    "fmin": lambda x, y: min(np.float32(x), np.float32(y)),
}
_CASADI = {"where": "if_else"}
_PLAIN = (float, int)  # bool is an int


def _apply(name: str, *args: Any) -> Any:
    for special in args:
        if not isinstance(special, _PLAIN):
            break
    else:
        return _FLOATS[name](*args)
    operation = getattr(special, "_bywire_op", None)
    if operation is not None:
        return operation(name, *args)
    if is_symbol(special):
        import casadi

        return getattr(casadi, _CASADI.get(name, name))(*args)
    if name in _SINGLES and isinstance(special, np.float32):
        return _SINGLES[name](*args)
    return getattr(np, name)(*args)


def is_symbol(value: Any) -> bool:
    """Return whether a value is a symbol, which cannot be compared with a range."""
    return type(value).__module__.startswith("casadi")


def exp(x: float) -> float:
    """Return e to the power of x; x is a pure number."""
    return _apply("exp", x)  # type: ignore[no-any-return]


DECAYED = 40.0
"""argument above which ``decay`` is 0, because exp(-40) = 4e-18 is below the resolution of 1.0"""


def decay(x: float, *, rests: bool = False) -> float:
    """Return e to the power of -x for a pure number x >= 0, and exactly 0 for x > 40.

    Use it for terms that are added to a number on the order of one. At high speed on a Stribeck
    curve, kernels can then skip the exponential.

    Parameters
    ----------
    rests
        Whether x is often exactly 0. Kernels then also skip the exponential at 0, but need two more
        operations for other x.
    """
    if not rests:
        return where(x < DECAYED, exp(-x), 0.0)
    half = 0.5 * DECAYED
    away = x - half  # a single comparison covers both ends
    return where(away * away < half * half, exp(-x), where(x < half, 1.0, 0.0))


def log(x: float) -> float:
    """Return the natural logarithm of x; x is a pure number > 0."""
    return _apply("log", x)  # type: ignore[no-any-return]


def sqrt(x: float) -> float:
    """Return the square root. Keep x away from 0, where the derivative is infinite."""
    return _apply("sqrt", x)  # type: ignore[no-any-return]


def sin(x: float) -> float:
    """Return the sine of x [rad]."""
    return _apply("sin", x)  # type: ignore[no-any-return]


def cos(x: float) -> float:
    """Return the cosine of x [rad]."""
    return _apply("cos", x)  # type: ignore[no-any-return]


def arctan(x: float) -> float:
    """Return the angle [rad] between -pi/2 and pi/2 whose tangent is x; x is a pure number."""
    return _apply("arctan", x)  # type: ignore[no-any-return]


def fabs(x: float) -> float:
    """Return the magnitude of x."""
    return _apply("fabs", x)  # type: ignore[no-any-return]


def floor(x: float) -> float:
    """Return the largest whole number that does not exceed x; x is a pure number."""
    return _apply("floor", x)  # type: ignore[no-any-return]


def fmax(x: float, y: float) -> float:
    """Return the larger of two quantities with the same unit."""
    return _apply("fmax", x, y)  # type: ignore[no-any-return]


def fmin(x: float, y: float) -> float:
    """Return the smaller of two quantities with the same unit."""
    return _apply("fmin", x, y)  # type: ignore[no-any-return]


def power(x: float, exponent: float) -> float:
    """Return x to a real power; x is a pure number >= 0."""
    return _apply("power", x, exponent)  # type: ignore[no-any-return]


def clip(x: float, low: float, high: float) -> float:
    """Return x limited to [low, high]."""
    return fmin(fmax(x, low), high)


def where(condition: Any, then: float, otherwise: float) -> float:
    """Return ``then`` if the condition is true, else ``otherwise``; both are evaluated."""
    if isinstance(condition, (bool, np.bool_)):
        return then if condition else otherwise
    return _apply("where", condition, then, otherwise)  # type: ignore[no-any-return]


def interpolate(x: float, xs: tuple[float, ...], ys: tuple[float, ...]) -> float:
    """Return the piecewise linear interpolation of (xs, ys), which is constant outside the nodes.

    Parameters
    ----------
    xs, ys
        Nodes, shape (n,) each; xs must increase.
    """
    y = ys[0]
    for x0, x1, y0, y1 in zip(xs[:-1], xs[1:], ys[:-1], ys[1:], strict=True):
        y = y + (y1 - y0) / (x1 - x0) * (clip(x, x0, x1) - x0)
    return y
