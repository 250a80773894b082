"""JAX arrays that the model's equations accept.

``core.ops`` calls NumPy for unknown types, but NumPy cannot work on values that JAX traces. An
object with ``_bywire_op`` supplies its own functions.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp

_NAMES = {"fabs": "abs", "fmax": "maximum", "fmin": "minimum"}


class Traced:
    """A traced scalar with arithmetic, comparisons, and the functions in the equations."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def _bywire_op(self, name: str, *args: Any) -> Traced:
        return Traced(getattr(jnp, _NAMES.get(name, name))(*(_bare(a) for a in args)))

    def __add__(self, other: Any) -> Traced:
        """Return the sum."""
        return Traced(self.value + _bare(other))

    def __sub__(self, other: Any) -> Traced:
        """Return the difference."""
        return Traced(self.value - _bare(other))

    def __rsub__(self, other: Any) -> Traced:
        """Return the reversed difference."""
        return Traced(_bare(other) - self.value)

    def __mul__(self, other: Any) -> Traced:
        """Return the product."""
        return Traced(self.value * _bare(other))

    def __truediv__(self, other: Any) -> Traced:
        """Return the quotient."""
        return Traced(self.value / _bare(other))

    def __rtruediv__(self, other: Any) -> Traced:
        """Return the reversed quotient."""
        return Traced(_bare(other) / self.value)

    def __neg__(self) -> Traced:
        """Return the negative."""
        return Traced(-self.value)

    def __lt__(self, other: Any) -> Traced:
        """Return whether the value is smaller."""
        return Traced(self.value < _bare(other))

    def __gt__(self, other: Any) -> Traced:
        """Return whether the value is larger."""
        return Traced(self.value > _bare(other))

    def __ge__(self, other: Any) -> Traced:
        """Return whether the value is larger or equal."""
        return Traced(self.value >= _bare(other))

    __radd__ = __add__
    __rmul__ = __mul__


def _bare(x: Any) -> Any:
    return x.value if isinstance(x, Traced) else x


def stacked(values: Iterable[Any]) -> Any:
    """Return a vector of traced scalars, and of numbers if an equation is constant."""
    return jnp.stack([jnp.asarray(_bare(value), dtype=float) for value in values])


def traced_signals(tuple_type: Any, values: Any) -> Any:
    """Return the entries of a traced vector as a signal tuple."""
    return tuple_type(*(Traced(value) for value in values))
