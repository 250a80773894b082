"""Results of estimators: values with their uncertainty, and undetermined unknowns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.identification.unknown import Unknown

_FEWEST = 30  # residuals that determine their noise
_RESOLVED = 2.0**-24  # of a signal's size: resolution of single precision and the finest converters


@dataclass(frozen=True)
class Part:
    """Neighboring residuals of one kind: of one output, in one record.

    Parameters
    ----------
    name, record
        Measured signal, and the label of its record; empty if there is only one.
    count
        Number of residuals.
    unit
        Unit of the signal.
    noise
        Divisor of the residuals [unit]; None if no noise was assumed.
    spread
        Standard deviation of the signal that the model has to explain [unit].
    size
        Largest magnitude of the signal [unit].
    numerical
        Root mean square of the change at half the simulation step [unit].
    """

    name: str
    record: str
    count: int
    unit: str = "1"
    noise: float | None = None
    spread: float = 0.0
    size: float = 0.0
    numerical: float = 0.0

    @property
    def label(self) -> str:
        """Name, with the record's if there are several."""
        return f"{self.record}:{self.name}" if self.record else self.name


@dataclass(frozen=True)
class Leftover:
    """Residuals of one output in one record.

    Parameters
    ----------
    label, unit
        Measured signal, with the record's label if there are several.
    residuals
        Computed minus measured [unit], shape (n,).
    noise
        Assumed standard deviation [unit], or None.
    spread, size, numerical
        See `Part` [unit].
    """

    label: str
    unit: str
    residuals: Array
    noise: float | None
    spread: float
    size: float = 0.0
    numerical: float = 0.0

    @property
    def rms(self) -> float:
        """Root mean square [unit]."""
        return math.sqrt(float(np.mean(self.residuals**2))) if self.residuals.size else 0.0

    @property
    def is_rounding(self) -> bool:
        """Whether the residual is below the resolution, so the model itself made the record."""
        return self.rms <= _RESOLVED * max(self.size, self.spread)

    @property
    def is_numerical(self) -> bool:
        """Whether rounding or the simulation step explains the residual."""
        return self.is_rounding or self.rms <= self.numerical

    @property
    def fit(self) -> float:
        """100 (1 - rms / spread) [%]: 100 without residual, 0 where a constant fits as well.

        NaN where the measured signal is constant (Ljung 1999, section 16.4).
        """
        return 100.0 * (1.0 - self.rms / self.spread) if self.spread > 0.0 else math.nan

    @property
    def over_noise(self) -> float:
        """Ratio of rms to the noise that the residuals' third differences show.

        About 1 for noise. A wrong model leaves slow residuals, which third differences hardly
        contain, so the ratio is larger. NaN for too few residuals.
        """
        if self.residuals.size < _FEWEST:
            return math.nan
        # Third differences of white noise have 20 times its variance. The mean square, not the
        # median: a rounded encoder signal is constant between jumps.
        noise = math.sqrt(float(np.mean(np.diff(self.residuals, 3) ** 2)) / 20.0)
        return self.rms / noise if noise > 0.0 else math.nan


# --- Estimates

_AT = 1e-6  # of an unknown's scale: a value this close to a bound is at the bound
_INDISTINCT = 0.05  # of a standard deviation: likewise


@dataclass(frozen=True)
class Kept:
    """An unknown that the data do not determine.

    Parameters
    ----------
    unknown
        The unknown; its start is the kept value.
    reason
        Reason, with numbers.
    """

    unknown: Unknown
    reason: str


@dataclass(frozen=True)
class Estimate:
    """Estimated unknowns.

    Parameters
    ----------
    unknowns
        Estimated unknowns; p of them.
    values
        Estimates, shape (p,), SI.
    covariance
        Covariance of the estimates, shape (p, p).
    singular_values
        Singular values of the Jacobian per unknown's scale, shape (p,), largest first. A small one
        means a combination that the data hardly determine.
    residuals
        Computed minus measured, divided by the noise, shape (n,): about one if the noise is as
        assumed. A robust loss does not weight them.
    freedom
        Degrees of freedom: independent residuals minus unknowns.
    colored
        Whether neighboring residuals are correlated, which the covariance then includes.
    kept
        Unknowns that the data do not determine, kept at their starts.
    notes
        Notes for the user.
    parts
        Groups of residuals in their order, with unit, noise and spread.
    step_errors
        Error of each value from the simulation step, shape (p,), SI; None without a simulation.
        Errors from noise (see the intervals) and from an incomplete model are additional.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    covariance: Array
    singular_values: Array
    residuals: Array
    freedom: float
    colored: bool
    kept: tuple[Kept, ...] = ()
    notes: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    step_errors: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Labels of the unknowns."""
        return tuple(u.label for u in self.unknowns)

    @property
    def all_unknowns(self) -> tuple[Unknown, ...]:
        """Estimated and undetermined unknowns."""
        return (*self.unknowns, *(kept.unknown for kept in self.kept))

    @property
    def deviations(self) -> Array:
        """Standard deviations, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the estimates, shape (p, p)."""
        product = np.outer(self.deviations, self.deviations)
        alone = np.eye(len(product))  # of values without a deviation, if the residual is zero
        return np.divide(self.covariance, product, out=alone, where=product > 0.0)

    def intervals(self, level: float = 0.95) -> Array:
        """Return the confidence intervals (Student's t), shape (p, 2)."""
        from scipy import special  # loads much faster than scipy.stats

        t = float(special.stdtrit(max(self.freedom, 1.0), 0.5 + 0.5 * level))
        reach = t * self.deviations
        return np.column_stack((self.values - reach, self.values + reach))

    def at_bounds(self) -> dict[str, float]:
        """Return the unknowns at a bound: label -> bound, SI."""
        return {
            u.label: end
            for u, value, d in zip(self.unknowns, self.values, self.deviations, strict=True)
            for end in (u.low, u.high)
            if math.isfinite(end) and abs(value - end) < max(_AT * u.scale, _INDISTINCT * d)
        }

    def vague(self) -> dict[str, str]:
        """Return the unknowns whose values are meaningless: label -> reason.

        They are at a bound, or their 95 % interval exceeds +-100 % of the value.
        """
        bounds = self.at_bounds()
        reach = 0.5 * np.diff(self.intervals(), axis=1).ravel()
        reasons = {}
        for u, value, half in zip(self.unknowns, self.values, reach, strict=True):
            if u.label in bounds:
                reasons[u.label] = f"is at its bound, {shown(bounds[u.label], u.unit)}"
            elif half > abs(value):
                reasons[u.label] = f"is {value:.3g} +- {half:.2g} {u.unit}, so it may be zero"
        return reasons

    def noted(self, notes: tuple[str, ...]) -> Estimate:
        """Return the estimate with additional notes."""
        return replace(self, notes=(*self.notes, *notes))

    def __getitem__(self, name: str) -> float:
        """Return the estimate of an unknown by its label."""
        return float(self.values[self.names.index(name)])

    def correlated(self, above: float = 0.9) -> list[tuple[str, str, float]]:
        """Return the strongly correlated pairs of unknowns, worst first."""
        c = self.correlation
        pairs = [
            (self.names[i], self.names[j], float(c[i, j]))
            for i in range(len(c))
            for j in range(i)
            if abs(c[i, j]) > above
        ]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))

    def parameters(self) -> dict[str, float]:
        """Return the estimated parameters by name, for [set] of a bench file."""
        return {
            u.name: float(v)
            for u, v in zip(self.unknowns, self.values, strict=True)
            if not u.trial and u.name.split(".")[0] not in ("initial", "stimulus", "offset")
        }

    def __str__(self) -> str:
        """Return a table of the estimates with their 95 % intervals."""
        rows = [
            f"{name:<16} {v:>12.5g} +- {half:<10.2g} {u.unit}"
            for name, u, v, half in zip(
                self.names,
                self.unknowns,
                self.values,
                0.5 * np.diff(self.intervals(), axis=1).ravel(),
                strict=True,
            )
        ]
        kept = [
            f"{k.unknown.label:<16} not determined by the data, kept at {k.unknown.start:g} "
            f"{k.unknown.unit}: {k.reason}"
            for k in self.kept
        ]
        left = [
            f"residual of {leftover.label} "
            + shown(float(f"{leftover.rms:.3g}"), difference_unit(leftover.unit))
            + (f", fit {leftover.fit:.1f} %" if math.isfinite(leftover.fit) else "")
            for leftover in self.leftovers()
        ]
        return "\n".join((*rows, *kept, *left, *self.notes))

    @property
    def rms(self) -> float:
        """Root mean square of the residuals; 1 if the noise is as assumed."""
        return math.sqrt(float(np.mean(self.residuals**2)))

    @property
    def is_exact(self) -> bool:
        """Whether the residual is only rounding, so the model itself made the record."""
        leftovers = self.leftovers()
        return bool(leftovers) and all(left.is_rounding for left in leftovers)

    def leftovers(self) -> tuple[Leftover, ...]:
        """Return the residuals of each part of the measurement, in its unit."""
        begin, parts = 0, []
        for part in self.parts:
            r = self.residuals[begin : begin + part.count] * (part.noise or 1.0)
            parts.append(
                Leftover(
                    part.label, part.unit, r, part.noise, part.spread, part.size, part.numerical
                )
            )
            begin += part.count
        return tuple(parts)


def as_object(estimate: Estimate) -> dict[str, object]:
    """Return an estimate as JSON data."""
    rows: Mapping[str, dict[str, object]] = {
        name: {
            "value": float(v),
            "unit": u.unit,
            "standard_deviation": float(d),
            "interval_95": [float(lo), float(hi)],
        }
        for name, u, v, d, (lo, hi) in zip(
            estimate.names,
            estimate.unknowns,
            estimate.values,
            estimate.deviations,
            estimate.intervals(),
            strict=True,
        )
    }
    if estimate.step_errors is not None:
        for row, error in zip(rows.values(), estimate.step_errors, strict=True):
            row["step_error"] = float(error)
    return {
        "parameters": rows,
        "not_identifiable": {
            k.unknown.label: {"kept": k.unknown.start, "unit": k.unknown.unit, "reason": k.reason}
            for k in estimate.kept
        },
        "correlation": {"names": list(estimate.names), "matrix": estimate.correlation.tolist()},
        "singular_values": estimate.singular_values.tolist(),
        "residual_rms": estimate.rms,
        "outputs": {
            left.label: {
                "unit": left.unit,
                "rms": left.rms,
                "fit_percent": left.fit if math.isfinite(left.fit) else None,
                "over_noise": left.over_noise if math.isfinite(left.over_noise) else None,
            }
            for left in estimate.leftovers()
        },
        "degrees_of_freedom": float(estimate.freedom),
        "colored_residuals": estimate.colored,
        "notes": list(estimate.notes),
    }
