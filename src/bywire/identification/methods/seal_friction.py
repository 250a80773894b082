"""Pressure-dependent friction of a sealed piston, from strokes at several pressures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Frequency, Nodes, Position, Unit
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.data.labeled import over
from bywire.identification.differentiation import low_passed
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.measured import after_one_another, joined, split, wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown

_CROSSED = 0.8  # fraction of the evaluated travel that a stroke must cross
_LEVEL = 0.01  # probability of a false alarm
_FEWEST_STROKES = 4  # minimum number that shows a drift
_APART = 1.2  # minimum ratio of the highest to the lowest pressure


@dataclass(frozen=True)
class Stroke:
    """One stroke through the evaluated travel.

    Parameters
    ----------
    direction
        1 outward, -1 inward.
    rows
        Samples of the record that slide in this stroke.
    """

    direction: int
    rows: NDArray[np.intp]


def velocity(x: Array, interval: float, cutoff: float) -> Array:
    """Return the low-passed velocity of a measured travel; gaps are interpolated linearly.

    Parameters
    ----------
    x
        Travel [m], shape (n,); NaN in gaps.
    interval, cutoff
        Sample time [s] and cutoff frequency [Hz].
    """
    there = np.isfinite(x)
    at = np.arange(x.size)
    whole = x if there.all() else np.interp(at, at[there], x[there])
    return np.gradient(low_passed(whole, interval, cutoff), interval)


def _find_strokes(x: Array, v: Array, low: float, high: float, slowest: float) -> list[Stroke]:
    """Return the strokes through a range of travel.

    Parameters
    ----------
    x, v
        Travel [m] and velocity [m/s], shape (n,).
    low, high
        Ends of the range [m].
    slowest
        Minimum speed [m/s]; slower samples stick, creep or reverse, and do not count.
    """
    inside = np.isfinite(x) & (x > low) & (x < high)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], inside.astype(int), [0]))))
    strokes = []
    for begin, end in edges.reshape(-1, 2).tolist():
        travel = float(x[end - 1] - x[begin])
        if abs(travel) < _CROSSED * (high - low):
            continue
        direction = 1 if travel > 0 else -1
        rows = begin + np.flatnonzero(direction * v[begin:end] > slowest)
        if rows.size:
            strokes.append(Stroke(direction, rows))
    return strokes


@dataclass(frozen=True)
class Group:
    """Strokes of one record in one direction.

    Parameters
    ----------
    direction
        1 outward, -1 inward.
    p, F
        Means over the strokes [Pa, N].
    scatter
        Standard deviation of F from stroke to stroke [N].
    strokes
        Means of each stroke, in their order: time [s], p, F; shape (count, 3).
    record
        Label of the record; empty if there is only one.
    """

    direction: int
    p: float
    F: float
    scatter: float
    strokes: Array
    record: str = ""

    @property
    def label(self) -> str:
        """Record and direction, in words."""
        way = "outward" if self.direction > 0 else "inward"
        return f"{self.record} {way}" if self.record else way


def _grouped(
    record: xr.Dataset, stretch: tuple[float, float], slowest: float, cutoff: float, label: str = ""
) -> list[Group]:
    """Return the groups of a record, outward first.

    Parameters
    ----------
    record
        ``x`` [m], ``p`` [Pa] and ``F`` [N] over ``time`` [s], evenly spaced.
    stretch
        Ends of the evaluated travel [m].
    slowest
        Speed above which the piston slides [m/s].
    cutoff
        Cutoff of the low-pass filter applied to the travel before differentiation [Hz].
    label
        Label of the record.
    """
    time = record["time"].values
    x, p, F = (record[name].values for name in ("x", "p", "F"))
    v = velocity(x, even_interval(time), cutoff)
    strokes = _find_strokes(x, v, *stretch, slowest)
    groups = []
    for direction in (1, -1):
        means = np.array(
            [
                (time[s.rows].mean(), np.nanmean(p[s.rows]), np.nanmean(F[s.rows]))
                for s in strokes
                if s.direction == direction and np.isfinite(F[s.rows]).any()
            ]
        )
        if means.size:
            scatter = float(means[:, 2].std(ddof=1)) if len(means) > 1 else 0.0
            _, p_mean, F_mean = means.mean(axis=0).tolist()
            groups.append(Group(direction, p_mean, F_mean, scatter, means, label))
    return groups


def _require_told(groups: Sequence[Group]) -> None:
    """Reject strokes that do not separate friction and area, or the two parts of friction.

    Raises
    ------
    ParameterError
        When there are no strokes, or only strokes in one direction or at one pressure.
    """
    if not groups:
        raise ParameterError(
            "no stroke covers the range x_low to x_high. Move the piston back and forth through "
            f"this range, or set {option('options')} x_low and x_high to the piston's range",
            name="x_low",
        )
    if len({g.direction for g in groups}) < 2:
        raise ParameterError(
            "F_0 and f need strokes in both directions, because only friction changes sign. "
            "Record strokes in both directions",
            name="F_0",
        )
    levels = [g.p for g in groups]
    if max(levels) < _APART * min(levels) or len(groups) < 4:
        raise ParameterError(
            f"f cannot be separated from F_0, because all strokes were made at "
            f"{min(levels) / 1e5:.3g} to {max(levels) / 1e5:.3g} bar. Provide one record per "
            "pressure, at two or more pressures",
            name="f",
        )


def _require_signs(A: float, friction: float) -> None:
    """Reject a negative area, and friction that drives.

    Parameters
    ----------
    A
        Force over pressure [m^2].
    friction
        Mean over all strokes [N].

    Raises
    ------
    ParameterError
        When a signal has the wrong sign. The force acts against the pressure, and is larger
        outward than inward.
    """
    if A < 0.0:
        raise wrong_sign(
            "F", "p", f"the area is {shown(float(f'{A:.4g}'), 'm**2')}, but must be > 0"
        )
    if friction < 0.0:
        raise wrong_sign("F", "x", f"the mean friction is {friction:.3g} N, but must be > 0 N")


def _half_widths(groups: Sequence[Group]) -> tuple[Array, Array]:
    """Return mean pressure and half the loop height of neighboring outward and inward groups."""
    pairs = [(a, b) for a, b in pairwise(groups) if a.direction == 1 and b.direction == -1]
    p = np.array([0.5 * (a.p + b.p) for a, b in pairs])
    return p, np.array([0.5 * (a.F - b.F) for a, b in pairs])


def _pressure_between(groups: Sequence[Group]) -> float:
    """Return the pressure difference between outward and inward strokes [Pa]."""
    up, down = (np.mean([g.p for g in groups if g.direction == d]) for d in (1, -1))
    return float(up - down)


def _drifting(groups: Sequence[Group], area: float) -> tuple[str, ...]:
    """Return the groups whose force drifts from stroke to stroke, with the drift.

    Parameters
    ----------
    groups
        Groups of all records.
    area
        Force over pressure [m^2], to exclude the drift of the pressure itself.
    """
    from scipy import stats

    texts = []
    for group in groups:
        time, p, F = group.strokes.T
        if time.size < _FEWEST_STROKES:
            continue
        line = stats.linregress(time, F - area * p)
        if line.pvalue < _LEVEL / len(groups):
            change = float(line.slope * np.ptp(time))
            texts.append(
                f"{group.label}: the force drifts by {change:.2g} N over {time.size} strokes. "
                "Run the seal in first, or trim the record"
            )
    return tuple(texts)


def _misfits(groups: Sequence[Group], W: Array, F: Array) -> tuple[str, ...]:
    """Return the records that deviate from the fit of all others, with the deviation.

    The mean forces of each record are compared with the prediction of the fit without it.

    Parameters
    ----------
    groups
        In the order of the rows.
    W, F
        The regression: shapes (n, p) and (n,).
    """
    from scipy import stats

    texts, (n, p) = [], W.shape
    labels = np.array([group.record for group in groups])
    for label in dict.fromkeys(labels.tolist()):
        held = labels == label
        rest, count = ~held, int(held.sum())
        freedom = n - count - p
        if freedom < 1 or np.linalg.matrix_rank(W[rest] / np.linalg.norm(W, axis=0)) < p:
            continue
        values = np.linalg.lstsq(W[rest], F[rest], rcond=None)[0]
        left = F[rest] - W[rest] @ values
        off = F[held] - W[held] @ values
        inverse = np.linalg.pinv(W[rest]) @ np.linalg.pinv(W[rest]).T
        spread = np.eye(count) + W[held] @ inverse @ W[held].T
        variance = max(float(left @ left) / freedom, 1e-300)
        ratio = float(off @ np.linalg.solve(spread, off)) / count / variance
        if ratio > stats.f.isf(_LEVEL / len(groups), count, freedom):
            texts.append(
                f"{label or 'the record'} deviates by {float(np.abs(off).max()):.2g} N from the "
                "fit to all other records. Check its sensor zeros, its pressure and its run-in"
            )
    return tuple(texts)


# --- Curves: the line over pressure, and the force while it slides


def _friction_line(fit: Estimate, groups: Sequence[Group]) -> Curve:
    """Return friction per unit pressure with its band, and the value of each group."""
    offset = fit["F_off"] if "F_off" in fit.names else 0.0
    seen = {g.p: g.direction * (g.F - fit["A"] * g.p - offset) for g in groups}
    p = np.union1d(np.linspace(0.0, 1.1 * max(seen), 60), list(seen))
    places = [fit.names.index(n) for n in ("F_0", "f") if n in fit.names]
    rows = np.column_stack((np.ones(p.size), p))[:, : len(places)]
    value = rows @ fit.values[places]
    variance = np.einsum("ni,ij,nj->n", rows, fit.covariance[np.ix_(places, places)], rows)
    half = 0.5 * float(np.diff(fit.intervals()[0])[0]) / float(fit.deviations[0])
    reach = half * np.sqrt(variance)
    columns = {
        "value": value,
        "low": value - reach,
        "high": value + reach,
        "measured": np.array([seen.get(float(v), np.nan) for v in p]),
    }
    return Curve(
        "friction",
        "Friction versus pressure with its 95 % band; one point per record and direction.",
        over(("p", p, "Pa", "pressure"), columns, "N", "friction"),
        "p",
    )


def _sliding_force(
    records: Mapping[str, xr.Dataset],
    fit: Estimate,
    stretch: tuple[float, float],
    slowest: float,
    cutoff: float,
) -> Curve:
    """Return the sliding force, measured and modeled, one record after another."""
    pairs, times = [], {}
    for name, record in records.items():
        times[name] = record["time"].values - record["time"].values[0]
        pairs.append(_sliding(record, fit, stretch, slowest, cutoff))
    return Curve(
        "strokes",
        "Measured and modeled force while the piston slides, one record after another.",
        _beside(pairs, after_one_another(times)),
        "time",
    )


def _force_over_travel(
    records: Mapping[str, xr.Dataset],
    fit: Estimate,
    stretch: tuple[float, float],
    slowest: float,
    cutoff: float,
) -> Curve:
    """Return loops of the sliding force over travel, measured and modeled."""
    pairs = [_sliding(record, fit, stretch, slowest, cutoff) for record in records.values()]
    x = np.concatenate([record["x"].values for record in records.values()])
    axis = {"x": ("x", x, {"units": "m", "long_name": "travel"})}
    return Curve(
        "loops",
        "Force versus travel while the piston slides; a loop's height is twice the friction.",
        _beside(pairs, axis, "x"),
        "x",
    )


def _sliding(
    record: xr.Dataset, fit: Estimate, stretch: tuple[float, float], slowest: float, cutoff: float
) -> tuple[Array, Array]:
    """Return measured and modeled force, NaN where the piston does not slide."""
    offset = fit["F_off"] if "F_off" in fit.names else 0.0
    x, p, F = (record[n].values for n in ("x", "p", "F"))
    v = velocity(x, even_interval(record["time"].values), cutoff)
    model = np.full(F.size, np.nan)
    for stroke in _find_strokes(x, v, *stretch, slowest):
        k = stroke.rows
        model[k] = fit["A"] * p[k] + stroke.direction * (fit["F_0"] + fit["f"] * p[k]) + offset
    return np.where(np.isfinite(model), F, np.nan), model


def _beside(pairs: Sequence[tuple[Array, Array]], axis: Any, dim: str = "time") -> xr.Dataset:
    attrs = {"units": "N", "long_name": "force"}
    measured, modeled = (np.concatenate(columns) for columns in zip(*pairs, strict=True))
    return xr.Dataset({"measured": (dim, measured, attrs), "modeled": (dim, modeled, attrs)}, axis)


# --- The method

ForcePerPressure = Annotated[float, Unit("N/Pa", 1e-5), Field(ge=0, allow_inf_nan=False)]

_MISFIT = 0.1
_OFF_BORE = 0.1  # of the area: gain errors of sensors are a few per cent, those of wrong units more


class Truth(ParameterSet):
    """The piston of simulated measurements."""

    A: Annotated[float, Unit("m**2", 5e-4), Field(gt=0)]
    """area"""
    F_0: Force
    """friction without pressure"""
    f: ForcePerPressure
    """friction per unit pressure"""
    sigma_group: Force
    """scatter of the force between records and directions"""
    sigma_stroke: Force
    """scatter from stroke to stroke"""
    sigma_F: Force
    """noise of the force"""


class Options(ParameterSet):
    """Evaluated part of the strokes."""

    x_low: Position
    """lower end of the evaluated travel"""
    x_high: Position
    """upper end of the evaluated travel"""
    slowest: Annotated[float, Unit("m/s", 5e-3), Field(gt=0)]
    """speed above which the piston slides"""
    cutoff: Frequency
    """cutoff of the low-pass filter applied to the travel before differentiation"""
    bore: Annotated[float, Unit("m", 0.025), Field(ge=0, allow_inf_nan=False)]
    """diameter of the cylinder, to check the area; 0 if unknown"""
    zero: Literal["known", "free"]
    """zero offset of the force sensor: assumed to be zero, or estimated"""
    pressures: Annotated[Nodes, Unit("Pa", 2e6), Field(min_length=2)]
    """chamber pressures of simulated records, one per record"""
    interval: Duration
    """sample time of simulated records"""
    truth: Truth


def identify(data: xr.Dataset, par: None, options: Options, effort: Effort) -> Identified:
    r"""Return area and friction.

    .. math::
        F = A p + s\,(F_0 + f p) + F_{off}, \qquad s = \mathrm{sgn}(v)

    The mean force of all strokes of a record in one direction is one measured value, since
    the strokes of a record are not independent. Each direction has its own pressure, because a
    regulator keeps the pressure higher while the piston moves against it.

    Parameters
    ----------
    data
        ``x``: travel [m], outward positive; ``p``: chamber pressure [Pa]; ``F``: force on the rod
        [N], positive against the pressure; several records.

    Raises
    ------
    ParameterError
        When there are no strokes, only one direction or pressure, or a signal has the wrong sign.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (16): Coulomb friction affine in the pressure.
    """
    records = split(data)
    how = ((options.x_low, options.x_high), options.slowest, options.cutoff)
    groups = [g for label, record in records.items() for g in _grouped(record, *how, label)]
    _require_told(groups)
    s, p, F = (np.array([getattr(g, n) for g in groups]) for n in ("direction", "p", "F"))
    columns = {"A": p, "F_0": s.astype(float), "f": s * p}
    if options.zero == "free":
        columns["F_off"] = np.ones(p.size)
    W = np.column_stack(list(columns.values()))
    sigma = _misfit(W, F)
    start = np.linalg.lstsq(W, F, rcond=None)[0]
    unknowns = tuple(_unknown(n, v, F, p) for n, v in zip(columns, start, strict=True))
    problem = Problem(unknowns, lambda values: ((W @ values - F) / sigma, W / sigma))
    fit = estimate(problem)
    friction = float(np.mean(fit["F_0"] + fit["f"] * p))
    _require_signs(fit["A"], friction)
    loop = np.polyfit(*_half_widths(groups), 1)
    return Identified(
        estimates={"seal friction": fit},
        parameters={},
        figures={
            "force_over_pressure": (fit["A"], "N/Pa"),
            "loop_half_width_at_0": (float(loop[1]), "N"),
            "loop_half_width_over_pressure": (float(loop[0]), "N/Pa"),
            "pressure_between_directions": (_pressure_between(groups), "Pa"),
        },
        checks=(
            Check(
                "misfit_over_friction",
                sigma / friction,
                limit=_MISFIT,
                note="residual of the mean forces about the line, relative to the mean friction",
                next_step=_advice(),
            ),
            Check(
                "stroke_scatter",
                float(np.sqrt(np.mean([g.scatter**2 for g in groups]))),
                "N",
                note="from stroke to stroke",
            ),
            *_bore_check(fit["A"], options.bore),
        ),
        curves=(
            _friction_line(fit, groups),
            _sliding_force(records, fit, *how),
            _force_over_travel(records, fit, *how),
        ),
        notes=(
            f"{sum(len(g.strokes) for g in groups)} strokes in {len(groups)} groups by record "
            "and direction",
            "loop half-widths neglect the pressure difference between the directions",
            *(f"{label} {reason}" for label, reason in fit.vague().items()),
            *_drifting(groups, fit["A"]),
            *_misfits(groups, W, F),
            *(() if options.bore else (_unchecked(),)),
        ),
    )


def _unchecked() -> str:
    return (
        f"bywire cannot check the units of pressure and force. Use "
        f"{option('options', {'bore': '25mm'})} to compare the area with a known bore"
    )


def _advice() -> str:
    return (
        "check 'pressure_between_directions' and the curve of each record. If one record deviates, "
        "identify without it. If all forces are shifted, use "
        f"{option('options', {'zero': 'free'})}. If friction depends on speed, or nonlinearly on "
        "pressure, run 'bywire identify friction-model' on friction, speed and pressure to "
        "compare such laws"
    )


def _bore_check(area: float, bore: float) -> tuple[Check, ...]:
    """Check the area against a known bore, which reveals wrong units."""
    if not bore:
        return ()
    known = 0.25 * math.pi * bore**2
    return (
        Check(
            "area_off_bore",
            abs(area / known - 1.0),
            limit=_OFF_BORE,
            note=f"the estimate is {1e6 * area:.5g} mm^2, and the bore's area is "
            f"{1e6 * known:.5g} mm^2. Above the limit, a unit of pressure or force is wrong",
            next_step=f"check both units in the file ({option('outputs')} 'p=COLUMN [bar]'), and "
            "the bore",
        ),
    )


def _unknown(name: str, start: float, F: Array, p: Array) -> Unknown:
    unit = {"A": "m**2", "f": "N/Pa"}.get(name, "N")
    scale = float(np.ptp(F) / np.ptp(p)) * {"A": 1.0, "f": 0.1}.get(name, 0.0)
    return Unknown(name, float(start), scale=scale or 0.1 * float(np.abs(F).max()), unit=unit)


def _misfit(W: Array, F: Array) -> float:
    left = F - W @ np.linalg.lstsq(W, F, rcond=None)[0]
    return max(float(np.sqrt(left @ left / max(F.size - W.shape[1], 1))), 1e-9)


def synthetic(par: None, options: Options, seed: int) -> xr.Dataset:
    """Simulate strokes in both directions at each pressure, with the scatter of real seals."""
    random, truth = np.random.default_rng(seed), options.truth
    t = np.arange(0.0, 40.0, options.interval)
    low, high = options.x_low, options.x_high
    reach = 0.6 * (high - low)
    phase = (t / 10.0) % 1.0  # there and back in 10 s
    x = 0.5 * (low + high) + reach * (1.0 - 4.0 * np.abs(phase - 0.5))
    s = np.where(phase < 0.5, 1.0, -1.0)
    stroke = np.floor(t / 5.0).astype(int)
    records = {}
    for k, level in enumerate(options.pressures):
        scatter = truth.sigma_group * random.standard_normal(2)[(s > 0).astype(int)]
        each = truth.sigma_stroke * random.standard_normal(stroke[-1] + 1)[stroke]
        p = level + 1e3 * random.standard_normal(t.size) + 3e3 * s
        F = truth.A * p + s * (truth.F_0 + truth.f * p) + scatter + each
        F = F + truth.sigma_F * random.standard_normal(t.size)
        records[f"level_{k}"] = xr.Dataset(
            {
                "x": ("time", x, {"units": "m"}),
                "p": ("time", p, {"units": "Pa"}),
                "F": ("time", F, {"units": "N"}),
            },
            {"time": ("time", t, {"units": "s"})},
        )
    return joined(records)


def known(par: None, options: Options) -> dict[str, float]:
    """Return the true values of simulated records."""
    truth = options.truth
    return {"A": truth.A, "F_0": truth.F_0, "f": truth.f, "F_off": 0.0}


METHOD = Method(
    name="seal-friction",
    assembly="",
    summary="friction of a sealed piston, from strokes in both directions (eq. (16) of "
    "Dardanelli et al.)",
    experiment="",
    signals={"F": "N", "x": "m", "p": "Pa"},
    options=Options,
    defaults=Options(
        x_low=5e-3,
        x_high=30e-3,
        slowest=5e-3,
        cutoff=5.0,
        bore=0.0,
        zero="known",
        pressures=(1e5, 3e5, 5e5, 7e5),
        interval=0.01,
        truth=Truth(A=4.9e-4, F_0=4.0, f=8e-6, sigma_group=0.3, sigma_stroke=0.1, sigma_F=0.05),
    ),
    identify=identify,
    synthetic=synthetic,
    unknowns=("A", "F_0", "f"),
    several=True,
    simulated=("pressures", "interval", "truth"),
    gaps=True,
    truth=known,
    further={
        "A": ("m**2", "area"),
        "F_0": ("N", "friction without pressure"),
        "f": ("N/Pa", "friction per unit pressure"),
        "F_off": ("N", "zero offset of the force sensor, with zero=free"),
    },
)
