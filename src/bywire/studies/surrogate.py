"""A surrogate: a key figure as a polynomial of what varies, and how far it is off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.typing import Array
from bywire.core.units import shown

_SHOWN = 6  # single values that an error names
_SAME = 1e-9  # share by which two texts of the same value may differ

Polynomial = Callable[[Array], Array]


@dataclass(frozen=True)
class Surrogate:
    """A key figure as a polynomial of what varies.

    Parameters
    ----------
    kpi, unit
        Key figure, and its unit.
    nominal
        What the bench has of each quantity [SI].
    units
        SI unit of each quantity.
    low, high
        Least and largest value of each quantity in the cases [SI].
    singles
        Values of the quantities that have single ones in the cases [SI], in rising order: between
        them nothing is known.
    cases
        Cases that have the figure.
    degree, terms
        Of the polynomial.
    rms, largest
        Error of cases that the polynomial had not seen, each fifth told by the others: root mean
        square, and largest, in ``unit``. The noise of the cases is in it.
    explained
        Share of the variance that it tells of cases it had not seen (Q2).
    """

    kpi: str
    unit: str
    nominal: Mapping[str, float]
    units: Mapping[str, str]
    low: Mapping[str, float]
    high: Mapping[str, float]
    singles: Mapping[str, Sequence[float]]
    cases: int
    degree: int
    terms: int
    rms: float
    largest: float
    explained: float
    polynomial: Polynomial = field(repr=False)

    def __call__(self, values: Mapping[str, ArrayLike]) -> Array:
        """Return the figure at values of what varies, in `unit`.

        Parameters
        ----------
        values
            Quantities by name [SI], numbers or arrays of one shape; the others as in the bench.

        Raises
        ------
        UnknownNameError
            For what did not vary.
        ParameterError
            Beyond what the cases have shown, and between the values of a quantity of single ones.
        """
        if not isinstance(values, Mapping):
            raise ParameterError(
                f"{quoted(values)}: SI numbers by the name of their quantity are wanted, such as "
                f"{{{next(iter(self.nominal))!r}: {next(iter(self.nominal.values())):g}}}"
            )
        for name in values:
            if name not in self.nominal:
                raise unknown_name("quantity of the surrogate", name, self.nominal)
        columns: list[Array] = []
        for name, nominal in self.nominal.items():
            try:
                column = np.asarray(values.get(name, nominal), dtype=float)
            except (TypeError, ValueError):
                raise ParameterError(
                    f"{name} = {quoted(values[name])}: SI numbers are wanted"
                ) from None
            self._require_seen(name, column)
            columns.append(column)
        try:
            wide = np.broadcast_arrays(*columns)
        except ValueError:
            raise ParameterError("values of quantities must have the same shape") from None
        points = np.column_stack([column.ravel() for column in wide])
        if not points.size:  # OpenTURNS takes no empty sample
            return np.zeros(wide[0].shape)
        return np.asarray(self.polynomial(points).reshape(wide[0].shape))

    def _require_seen(self, name: str, values: Array) -> None:
        low, high = self.low[name], self.high[name]
        at_end = np.isclose(values, low, _SAME, 0.0) | np.isclose(values, high, _SAME, 0.0)
        beyond = values[~((low <= values) & (values <= high) | at_end)]
        if beyond.size:
            unit = self.units[name]
            raise ParameterError(
                f"{name} = {shown(float(beyond[0]), unit)}: the surrogate of {self.kpi} knows "
                f"{shown(low, unit)} to {shown(high, unit)}, and nothing beyond"
            )
        singles = np.asarray(self.singles.get(name, ()))
        if not singles.size or not values.size:
            return
        flat = values.ravel()
        nearest = singles[np.abs(flat[:, None] - singles).argmin(axis=1)]
        between = ~np.isclose(flat, nearest, rtol=_SAME, atol=0.0)
        if between.any():
            unit, k = self.units[name], int(between.argmax())
            raise ParameterError(
                f"{name} = {shown(float(flat[k]), unit)}: in the cases it has single values, "
                f"{_listed(singles, unit)}, and nothing is known between them; the nearest is "
                f"{shown(float(nearest[k]), unit)}"
            )


def _listed(values: Array, unit: str) -> str:
    """Return single values as an error lists them: not all where they are many."""
    texts = [shown(float(value), unit) for value in values]
    if len(texts) > _SHOWN:
        texts = [*texts[: _SHOWN - 1], "...", texts[-1]]
    return ", ".join(texts)
