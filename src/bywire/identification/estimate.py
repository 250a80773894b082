"""What an estimator gives: values with their uncertainty, and what the data does not tell."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.identification.unknown import Unknown

_FEWEST = 30  # residuals that tell their noise
_RESOLVED = 2.0**-24  # of a signal's size: what single precision and the finest converters resolve


@dataclass(frozen=True)
class Part:
    """Neighboring residuals of one kind: of one output, in one record.

    Parameters
    ----------
    name, record
        What was measured, and the label of its record; empty where there is one alone.
    count
        How many residuals.
    unit
        Of what was measured.
    noise
        What they were divided by [unit]; None where no noise was assumed.
    spread
        Standard deviation of what the model has to explain [unit].
    size
        Largest magnitude of what was measured [unit].
    numerical
        Root mean square of what half the step of the simulation changes [unit].
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
        """Name, with the record's where there are several."""
        return f"{self.record}:{self.name}" if self.record else self.name


@dataclass(frozen=True)
class Leftover:
    """What a model leaves of one output in one record.

    Parameters
    ----------
    label, unit
        What was measured, with the record's label where there are several.
    residuals
        Computed less measured [unit], shape (n,).
    noise
        Standard deviation that was assumed [unit]; None for none.
    spread, size, numerical
        As of its `Part` [unit].
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
        """Whether no more is left than numbers resolve: the record is the model's own."""
        return self.rms <= _RESOLVED * max(self.size, self.spread)

    @property
    def is_numerical(self) -> bool:
        """Whether no more is left than rounding, or the step of the simulation, explains."""
        return self.is_rounding or self.rms <= self.numerical

    @property
    def fit(self) -> float:
        """100 (1 - rms / spread) [%]: 100 where nothing is left, 0 where a constant does as well.

        NaN where what was measured does not move (Ljung 1999, section 16.4).
        """
        return 100.0 * (1.0 - self.rms / self.spread) if self.spread > 0.0 else math.nan

    @property
    def over_noise(self) -> float:
        """Rms over the noise that the residuals' own third differences show.

        About 1 where they are noise; a model that is wrong leaves more, which changes slowly from
        sample to sample and which differences therefore hardly hold. NaN where they are too few.
        """
        if self.residuals.size < _FEWEST:
            return math.nan
        # Of white noise they have 20 times the variance. Their mean square, not their median: what
        # an encoder rounds rests from sample to sample, and jumps.
        noise = math.sqrt(float(np.mean(np.diff(self.residuals, 3) ** 2)) / 20.0)
        return self.rms / noise if noise > 0.0 else math.nan


# --- Estimates

_AT = 1e-6  # of an unknown's scale: nearer to a bound, it lies at it
_INDISTINCT = 0.05  # of a standard deviation: nearer to a bound, the data does not tell it from it


@dataclass(frozen=True)
class Kept:
    """An unknown that the data does not tell.

    Parameters
    ----------
    unknown
        What it is; its start is the value that was kept.
    reason
        Why it is not told, with numbers.
    """

    unknown: Unknown
    reason: str


@dataclass(frozen=True)
class Estimate:
    """Estimated unknowns.

    Parameters
    ----------
    unknowns
        What was estimated; p of them.
    values
        Estimates, shape (p,), SI.
    covariance
        Of the estimates, shape (p, p).
    singular_values
        Of the Jacobian whose columns are per unknown's scale, shape (p,), largest first: what
        is small beside the first one hardly shows in the data.
    residuals
        Computed less measured over the noise, shape (n,): of size one where the noise is as
        assumed. A robust loss has not weighted them.
    freedom
        Degrees of freedom: independent residuals less unknowns.
    colored
        Whether neighboring residuals go together, which the covariance then allows for.
    kept
        Unknowns that the data does not tell, left at their starts.
    notes
        What the user should know.
    parts
        Which residuals belong together, in their order, with unit, noise and spread.
    step_errors
        How far each value is off by the step of the simulation, shape (p,), SI; None where nothing
        is simulated. Noise, of which intervals speak, and what a model leaves out come on top.
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
        """What was estimated, and what the data does not tell."""
        return (*self.unknowns, *(kept.unknown for kept in self.kept))

    @property
    def deviations(self) -> Array:
        """Standard deviations, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the estimates, shape (p, p)."""
        product = np.outer(self.deviations, self.deviations)
        alone = np.eye(len(product))  # of values without a deviation, where nothing at all is left
        return np.divide(self.covariance, product, out=alone, where=product > 0.0)

    def intervals(self, level: float = 0.95) -> Array:
        """Return the confidence intervals (Student's t), shape (p, 2)."""
        from scipy import special  # of which stats is made, and takes long to load

        t = float(special.stdtrit(max(self.freedom, 1.0), 0.5 + 0.5 * level))
        reach = t * self.deviations
        return np.column_stack((self.values - reach, self.values + reach))

    def at_bounds(self) -> dict[str, float]:
        """Return the unknowns that lie at a bound: label -> bound, SI."""
        return {
            u.label: end
            for u, value, d in zip(self.unknowns, self.values, self.deviations, strict=True)
            for end in (u.low, u.high)
            if math.isfinite(end) and abs(value - end) < max(_AT * u.scale, _INDISTINCT * d)
        }

    def vague(self) -> dict[str, str]:
        """Return the unknowns whose values mean nothing: label -> why.

        They lie at a bound, or their 95 % interval reaches further than +-100 % of the value.
        """
        bounds = self.at_bounds()
        reach = 0.5 * np.diff(self.intervals(), axis=1).ravel()
        reasons = {}
        for u, value, half in zip(self.unknowns, self.values, reach, strict=True):
            if u.label in bounds:
                reasons[u.label] = f"is at its bound, {shown(bounds[u.label], u.unit)}"
            elif half > abs(value):
                reasons[u.label] = f"is {value:.3g} +- {half:.2g} {u.unit}: it may be zero"
        return reasons

    def noted(self, notes: tuple[str, ...]) -> Estimate:
        """Return the estimate with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def __getitem__(self, name: str) -> float:
        """Return the estimate of an unknown by its label."""
        return float(self.values[self.names.index(name)])

    def correlated(self, above: float = 0.9) -> list[tuple[str, str, float]]:
        """Return the pairs of unknowns that the data tells apart badly, worst first."""
        c = self.correlation
        pairs = [
            (self.names[i], self.names[j], float(c[i, j]))
            for i in range(len(c))
            for j in range(i)
            if abs(c[i, j]) > above
        ]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))

    def parameters(self) -> dict[str, float]:
        """Return the estimated parameters by name: what a bench file's [set] takes."""
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
        """Root mean square of the residuals; 1 where they are over a noise that is as assumed."""
        return math.sqrt(float(np.mean(self.residuals**2)))

    @property
    def is_exact(self) -> bool:
        """Whether nothing but rounding is left: the record is the model's own."""
        leftovers = self.leftovers()
        return bool(leftovers) and all(left.is_rounding for left in leftovers)

    def leftovers(self) -> tuple[Leftover, ...]:
        """Return what the model leaves of each part of the measurement, in its unit."""
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
    """Return what JSON holds of an estimate."""
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
