r"""Which friction law a record supports: Coulomb, viscous, asymmetric, with pressure, Stribeck.

All laws hold while sliding: :math:`F = s\,F_c(p)\,(1 + (k - 1) e^{-|v|/v_s}) + d v`, with the
direction :math:`s = \mathrm{sgn}(v)`; simpler laws omit terms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Nodes, Unit
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.identification.estimate import Estimate
from bywire.identification.measured import after_one_another, joined, split, wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.model_choice import Candidate, Choice, choose
from bywire.identification.unknown import Unknown

_APART = 1.2  # minimum ratio of pressures that determines friction per unit pressure
_LEAST = 20  # samples in each direction


@dataclass(frozen=True)
class Law:
    """Friction law as a choice of terms.

    Parameters
    ----------
    name
        Name of the law.
    viscous, stribeck, asymmetric, pressure
        Whether friction grows with speed, falls after breakaway, depends on the direction, and
        depends on the pressure.
    """

    name: str
    viscous: bool = False
    stribeck: bool = False
    asymmetric: bool = False
    pressure: bool = False

    def unknowns(self, data: xr.Dataset) -> tuple[Unknown, ...]:
        """Return the unknowns of the fit, with starts and units from the data."""
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
        """Return the law as a candidate for a model choice."""
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


def _laws_for(data: xr.Dataset) -> Sequence[Law]:
    """Return the laws that a record can separate: with pressure only if pressure varies enough."""
    if "pressure" in data:
        p = data["pressure"].values
        if float(np.max(p)) > _APART * max(float(np.min(p)), 0.0):
            return LAWS
    return tuple(law for law in LAWS if not law.pressure)


def _find_law(name: str) -> Law:
    """Return a law by its name."""
    return next(law for law in LAWS if law.name == name)


def _product(unit: str) -> str:
    return f"({unit})" if "/" in unit else unit


def _sliding(records: Mapping[str, xr.Dataset], slowest: float) -> dict[str, xr.Dataset]:
    """Return the samples that slide, by record.

    Parameters
    ----------
    records
        ``friction``, ``speed`` and, if measured, ``pressure`` over ``time``; NaN in gaps.
    slowest
        Minimum speed of used samples, as a fraction of the record's maximum speed.

    Raises
    ------
    ParameterError
        When too few samples slide forward or backward, or the friction drives the motion.
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
    """Reject records in which too few samples slide forward or backward."""
    v = np.concatenate([record["speed"].values for record in sliding.values()])
    counts = {"forward": int(np.sum(v > 0)), "backward": int(np.sum(v < 0))}
    short = [way for way, count in counts.items() if count < _LEAST]
    if short:
        each = ", ".join(f"{count} {way}" for way, count in counts.items())
        raise ParameterError(
            f"too few samples show sliding {' and '.join(short)} ({each}). At least {_LEAST} "
            "samples in each direction are needed. Record motion in both directions, or reduce "
            f"{option('options')} slowest, which "
            f"excludes samples below {100 * slowest:g} % of a record's maximum speed",
            name="slowest",
            value=f"{slowest:g}",
        )


def _require_braking(sliding: Mapping[str, xr.Dataset]) -> None:
    """Reject friction that supplies power on average over the record."""
    F, v = (
        np.concatenate([record[n].values for record in sliding.values()])
        for n in ("friction", "speed")
    )
    along = float(F @ v / np.sqrt((F @ F) * (v @ v))) if F.any() else 0.0
    if along < 0.0:
        raise wrong_sign(
            "friction", "speed", f"the cosine is {along:.2f}, but must be > 0 for passive friction"
        )


# --- The method

Share = Annotated[float, Unit("1", 0.01), Field(ge=0, lt=1)]
Size = Annotated[float, Unit("N", 10.0), Field(ge=0)]

_BINS, _MISFIT = 12, 0.05


class Truth(ParameterSet):
    """The friction of simulated records, in N and m/s."""

    F_p: Size
    """Coulomb friction, forward"""
    F_n: Size
    """Coulomb friction, backward"""
    f: Annotated[float, Unit("N/Pa", 1e-5), Field(ge=0)]
    """friction per unit pressure"""
    d: Annotated[float, Unit("N*s/m", 10.0), Field(ge=0)]
    """viscous friction"""
    k: Annotated[float, Unit("1", 1.5), Field(ge=1)]
    """ratio of breakaway friction to Coulomb friction"""
    v_s: Annotated[float, Unit("m/s", 0.01), Field(gt=0)]
    """Stribeck velocity"""
    noise: Size
    """standard deviation of the sensor's noise"""


class Options(ParameterSet):
    """Choice of laws and samples."""

    law: Literal[
        "choose",
        "coulomb",
        "viscous",
        "asymmetric",
        "pressure",
        "stribeck",
        "stribeck-asymmetric",
        "stribeck-pressure",
    ]
    """one of the laws, or 'choose' to compare all of them on held-out data"""
    slowest: Share
    """minimum speed as a fraction of the maximum speed; slower samples stick or reverse"""
    pressures: Annotated[Nodes, Unit("Pa", 2e6), Field(min_length=1)]
    """pressures of simulated records, one per record"""
    v_max: Annotated[float, Unit("m/s", 0.1), Field(gt=0)]
    """maximum speed of simulated records"""
    f_motion: Frequency
    """frequency of the motion in simulated records"""
    duration: Duration
    """length of simulated records"""
    interval: Duration
    """sample time of simulated records"""
    truth: Truth


def identify(data: xr.Dataset, par: None, options: Options, effort: Effort) -> Identified:
    """Choose a friction law and return its parameters.

    Parameters
    ----------
    data
        ``friction``: force or torque of friction alone, positive along the motion; ``speed``;
        ``pressure`` [Pa] if it is measured. With several records, whole records are held out.

    Raises
    ------
    ParameterError
        When too few samples slide in one direction, friction drives the motion, or the chosen law
        needs a pressure that varies.

    References
    ----------
    Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30 (7), section 2: the laws.
    """
    records = _sliding(split(data), options.slowest)
    whole = xr.concat(list(records.values()), "time", combine_attrs="override")
    known = _laws_for(whole)
    wanted = known if options.law == "choose" else (_find_law(options.law),)
    if wanted[0] not in known:
        raise ParameterError(
            f"law {options.law!r} needs a measured pressure that varies by at least 20 %",
            name="law",
            value=options.law,
        )
    choice = choose([law.candidate() for law in wanted], records, "friction")
    best = choice.chosen
    law = _find_law(best.candidate.name)
    unit = str(whole["friction"].attrs.get("units", "1"))
    values = [
        best.estimate[u.label] if u.label in best.estimate.names else u.start
        for u in law.unknowns(whole)
    ]
    predicted, _ = law.predict(whole, np.array(values))
    return Identified(
        estimates={law.name: best.estimate},
        parameters={},
        figures=_figures(choice, unit),
        checks=(
            Check(
                "misfit_over_friction",
                _misfit(whole, predicted),
                limit=_MISFIT,
                note="mean residual at a speed or a pressure, relative to the friction",
                next_step="find where the residual occurs in the curve. If it occurs at low speed, "
                "record slower strokes. If it depends on pressure, also provide pressure. If it "
                "differs from record to record, identify each record separately",
            ),
            Check(
                "validation_over_training",
                best.validation_error / best.training_error,
                limit=1.5,
                note="error on held-out data, relative to the error on fitted data",
                next_step="record more data, or the same speeds and pressures in each record",
            ),
            _driving(best.estimate),
        ),
        curves=(_curve(records, whole, predicted),),
        notes=(
            f"held out: {choice.held_out}. bywire chooses the simplest law within one standard "
            "error of the best",
        ),
    )


def _driving(fit: Estimate) -> Check:
    """Check that no term of the law drives the motion, with a 95 % interval below zero."""
    highest = dict(zip(fit.names, fit.intervals()[:, 1], strict=True))
    below = [n for n, high in highest.items() if high < 0.0]
    unit = {u.label: u.unit for u in fit.unknowns}
    driving = "; ".join(
        f"{n} = {shown(float(f'{fit[n]:.3g}'), unit[n])} drives the motion" for n in below
    )
    return Check(
        "terms_that_drive",
        float(len(below)),
        limit=0.0,
        note=driving or "no term of the law drives the motion",
        next_step="check the signs of friction and speed, and whether speeds and pressures "
        "vary enough to separate the terms of the law",
    )


def _figures(choice: Choice, unit: str) -> dict[str, tuple[float, str]]:
    lowest = [min(getattr(j, name) for j in choice.judged) for name in ("aic", "bic")]
    figures = {}
    for judged in choice.judged:
        name = judged.candidate.name
        figures[f"{name}: held-out error"] = (judged.validation_error, unit)
        figures[f"{name}: AIC less the least"] = (judged.aic - lowest[0], "1")
        figures[f"{name}: BIC less the least"] = (judged.bic - lowest[1], "1")
    return figures


def _misfit(whole: xr.Dataset, predicted: Array) -> float:
    """Return the RMS of the residual's class means, relative to the RMS of the friction.

    Classes of speed and classes of pressure, each by direction; the larger result counts.
    """
    F, v = whole["friction"].values, whole["speed"].values
    keys = [np.abs(v)] + ([whole["pressure"].values] if "pressure" in whole else [])
    errors = []
    for key in keys:
        means = []
        for way in (v > 0, v < 0):
            order = np.flatnonzero(way)[np.argsort(key[way], kind="stable")]
            means += [
                float(np.mean((F - predicted)[part]))
                for part in np.array_split(order, _BINS)
                if part.size
            ]
        errors.append(float(np.sqrt(np.mean(np.square(means)))))
    return max(errors) / float(np.sqrt(np.mean(F**2)))


def _curve(records: Mapping[str, xr.Dataset], whole: xr.Dataset, predicted: Array) -> Curve:
    attrs = {"units": whole["friction"].attrs.get("units", "1"), "long_name": "friction"}
    return Curve(
        "friction",
        "Measured friction during sliding, one record after another, and the chosen law.",
        xr.Dataset(
            {
                "measured": ("time", whole["friction"].values, attrs),
                "modeled": ("time", predicted, attrs),
            },
            after_one_another({name: record["time"].values for name, record in records.items()}),
        ),
        "time",
    )


def synthetic(par: None, options: Options, seed: int) -> xr.Dataset:
    """Simulate a sinusoidal speed at each pressure, with the true friction and noise."""
    random, truth = np.random.default_rng(seed), options.truth
    t = np.arange(0.0, options.duration, options.interval)
    v = options.v_max * np.sin(2.0 * np.pi * options.f_motion * t + 0.1)
    fall = 1.0 + (truth.k - 1.0) * np.exp(-np.abs(v) / truth.v_s)
    records = {}
    for k, p in enumerate(options.pressures):
        dry = np.where(v > 0, truth.F_p, truth.F_n) + truth.f * p
        F = np.sign(v) * dry * fall + truth.d * v + truth.noise * random.standard_normal(t.size)
        records[f"level_{k}"] = xr.Dataset(
            {
                "friction": ("time", F, {"units": "N"}),
                "speed": ("time", v, {"units": "m/s"}),
                "pressure": ("time", np.full(t.size, p), {"units": "Pa"}),
            },
            {"time": ("time", t, {"units": "s"})},
        )
    return joined(records)


def _known_values(par: None, options: Options) -> dict[str, float]:
    """Return the true values of simulated records, under the laws' names."""
    values = options.truth.leaves()
    values.pop("noise")
    return values | {"F_c": options.truth.F_p}


METHOD = Method(
    name="friction-model",
    assembly="",
    summary=f"choice among {len(LAWS)} friction laws by their error on held-out data",
    experiment="",
    signals={"friction": "", "speed": ""},
    options=Options,
    defaults=Options(
        law="choose",
        slowest=0.02,
        pressures=(5e5, 15e5, 25e5, 35e5),
        v_max=0.1,
        f_motion=0.5,
        duration=8.0,
        interval=0.01,
        truth=Truth(F_p=20.0, F_n=20.0, f=2e-5, d=60.0, k=1.6, v_s=0.01, noise=1.0),
    ),
    identify=identify,
    synthetic=synthetic,
    several=True,
    simulated=("pressures", "v_max", "f_motion", "duration", "interval", "truth"),
    gaps=True,
    optional={"pressure": "Pa"},
    truth=_known_values,
    further={
        "F_c": ("", "Coulomb friction (or F_p forward and F_n backward)"),
        "f": ("", "friction per unit pressure"),
        "d": ("", "viscous friction"),
        "k": ("1", "ratio of breakaway friction to Coulomb friction"),
        "v_s": ("", "Stribeck velocity"),
    },
)
