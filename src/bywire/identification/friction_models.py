r"""Friction laws of increasing detail, as candidates for what a friction record shows.

All hold while sliding: :math:`F = s\,F_c(p)\,(1 + (k - 1) e^{-|v|/v_s}) + d v`, with the direction
:math:`s = \mathrm{sgn}(v)`, less what a simpler law leaves out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.measured import wrong_sign
from bywire.identification.model_choice import Candidate
from bywire.identification.unknown import Unknown

_APART = 1.2  # ratio of pressures from which on friction over pressure can be told
_LEAST = 20  # samples each way


@dataclass(frozen=True)
class Law:
    """Which terms a law has.

    Parameters
    ----------
    name
        What it is called.
    viscous, stribeck, asymmetric, pressure
        Whether friction grows with speed; falls after breaking away; depends on the direction;
        depends on the pressure.
    """

    name: str
    viscous: bool = False
    stribeck: bool = False
    asymmetric: bool = False
    pressure: bool = False

    def unknowns(self, data: xr.Dataset) -> tuple[Unknown, ...]:
        """Return what it is fitted by, with starts and units from the data."""
        F, v = data["friction"].values, np.abs(data["speed"].values)
        force, rate = (str(data[n].attrs.get("units", "1")) for n in ("friction", "speed"))
        size, fast = float(np.mean(np.abs(F))), float(v.max())
        coulomb = [
            Unknown(name, size, low=0.0, scale=size, unit=force)
            for name in (("F_p", "F_n") if self.asymmetric else ("F_c",))
        ]
        if self.pressure:
            p = float(data["pressure"].values.max())
            f = 0.1 * size / p
            coulomb.append(Unknown("f", f, scale=10.0 * f, unit=f"{_product(force)}/Pa"))
        if self.viscous:
            d = size / fast
            coulomb.append(Unknown("d", 0.1 * d, scale=d, unit=f"{_product(force)}/({rate})"))
        if self.stribeck:
            slow = float(np.quantile(v, 0.2))
            coulomb.append(Unknown("k", 1.5, low=0.0, high=20.0, scale=1.0))
            coulomb.append(Unknown("v_s", slow, low=0.02 * slow, high=fast, scale=fast, unit=rate))
        return tuple(coulomb)

    def predict(self, data: xr.Dataset, values: Array) -> tuple[Array, Array]:
        """Return friction and its derivatives, shapes (n,) and (n, p)."""
        v = data["speed"].values
        s, left = np.sign(v), list(values)
        columns = [np.maximum(s, 0.0), np.minimum(s, 0.0)] if self.asymmetric else [s]
        if self.pressure:
            columns.append(s * data["pressure"].values)
        dry = np.column_stack(columns)
        size = dry @ np.array([left.pop(0) for _ in columns])
        viscous = left.pop(0) * v if self.viscous else 0.0
        if not self.stribeck:
            return size + viscous, np.column_stack((dry, v)) if self.viscous else dry
        k, v_s = left
        fall = np.exp(-np.abs(v) / v_s)
        factor = 1.0 + (k - 1.0) * fall
        slopes = [dry * factor[:, None]]
        slopes += [v[:, None]] if self.viscous else []
        slopes += [(size * fall)[:, None], (size * (k - 1.0) * fall * np.abs(v) / v_s**2)[:, None]]
        return size * factor + viscous, np.hstack(slopes)

    def candidate(self) -> Candidate:
        """Return it as a candidate of a model choice."""
        return Candidate(self.name, self.unknowns, self.predict)


LAWS = (
    Law("coulomb"),
    Law("viscous", viscous=True),
    Law("asymmetric", viscous=True, asymmetric=True),
    Law("pressure", viscous=True, pressure=True),
    Law("stribeck", viscous=True, stribeck=True),
    Law("stribeck-asymmetric", viscous=True, stribeck=True, asymmetric=True),
    Law("stribeck-pressure", viscous=True, stribeck=True, pressure=True),
)
"""the simplest first"""


def laws_for(data: xr.Dataset) -> Sequence[Law]:
    """Return the laws that a record can tell: those with pressure where it differs enough."""
    if "pressure" in data:
        p = data["pressure"].values
        if float(np.max(p)) > _APART * max(float(np.min(p)), 0.0):
            return LAWS
    return tuple(law for law in LAWS if not law.pressure)


def find_law(name: str) -> Law:
    """Return a law by its name."""
    return next(law for law in LAWS if law.name == name)


def _product(unit: str) -> str:
    return f"({unit})" if "/" in unit else unit


def sliding(records: Mapping[str, xr.Dataset], slowest: float) -> dict[str, xr.Dataset]:
    """Return the samples that slide, by record.

    Parameters
    ----------
    records
        ``friction``, ``speed`` and, where measured, ``pressure`` over ``time``; NaN in gaps.
    slowest
        Slower samples are left out; a share of the record's fastest speed.

    Raises
    ------
    ParameterError
        When too few slide forward or backward, or the friction drives the motion.
    """
    names = ("friction", "speed", "pressure")
    samples = {}
    for label, record in records.items():
        kept = record[[n for n in names if n in record]]
        v = np.abs(kept["speed"].values)
        good = np.all([np.isfinite(kept[n].values) for n in kept.data_vars], axis=0)
        rows = np.flatnonzero(good & (v > slowest * np.max(v[good], initial=0.0)))
        samples[label] = kept.isel(time=rows)
    _require_both_ways(samples, slowest)
    _require_braking(samples)
    return samples


def _require_both_ways(sliding: Mapping[str, xr.Dataset], slowest: float) -> None:
    """Refuse records in which too few samples slide forward, or backward."""
    v = np.concatenate([record["speed"].values for record in sliding.values()])
    counts = {"forward": int(np.sum(v > 0)), "backward": int(np.sum(v < 0))}
    short = [way for way, count in counts.items() if count < _LEAST]
    if short:
        said = ", ".join(f"{count} {way}" for way, count in counts.items())
        raise ParameterError(
            f"too few samples slide {' and '.join(short)} ({said}; {_LEAST} each way are needed): "
            "record motion to and fro (speed changes its sign), or lower "
            f"{option('options')} slowest, which "
            f"leaves out what is slower than {100 * slowest:g} % of a record's fastest speed"
        )


def _require_braking(sliding: Mapping[str, xr.Dataset]) -> None:
    """Refuse friction that gives power: it takes some up, in the mean over the record."""
    F, v = (
        np.concatenate([record[n].values for record in sliding.values()])
        for n in ("friction", "speed")
    )
    along = float(F @ v / np.sqrt((F @ F) * (v @ v))) if F.any() else 0.0
    if along < 0.0:
        raise wrong_sign("friction", "speed", f"cosine {along:.2f}: it would drive the motion")
