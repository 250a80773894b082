"""The paper's measurements with tolerances, and the parameters that explain them best.

Tables 1 and 2 come from theory and data sheets, so they do not count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np

from bywire.bench.experiment import Case, as_run
from bywire.bench.kpis.hysteresis import Loop, loop_area
from bywire.bench.kpis.samples import smoothed
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.experiments import friction_ramp, hard_braking
from bywire.brakes.motorcycle.methods.region_fit import (
    Points,
    Region,
    over_frequency,
    restricted,
    unknowns_of,
)
from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, FACTS, REGIONS, table4_model
from bywire.brakes.motorcycle.paper.runs import PRINTED, parameters
from bywire.brakes.motorcycle.paper.transfer_functions import step_peak
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, travel_at
from bywire.core.errors import ParameterError, SolverError
from bywire.core.parameters import leaf_fields
from bywire.core.typing import Array, Complex, Progress
from bywire.data.recursive_filter import low_passed
from bywire.identification.estimate import Estimate, Part
from bywire.identification.least_squares import Loss, Problem, estimate, influence, rho, solve
from bywire.identification.multistart import search
from bywire.identification.unknown import Unknown, moved, scattered
from bywire.reproduction.item import Allowance, Fact
from bywire.reproduction.source_file import SourceFile
from bywire.simulation.ensemble import fit_lanes, simulate_group
from bywire.simulation.run import Run, Trajectory, simulate


@dataclass(frozen=True)
class Statement:
    """A measured number in the paper.

    Parameters
    ----------
    name
        Name of the statement, and of its counterpart in ``computed``.
    fact
        Stated number and its place, its tolerance, and how the counterpart is computed.
    """

    name: str
    fact: Fact

    @property
    def allowance(self) -> Allowance:
        """Its tolerance and the reason."""
        return cast(Allowance, self.fact.tolerance)

    @property
    def tolerance(self) -> float:
        """Tolerance in the fact's unit, > 0."""
        return self.allowance.around(self.fact.value)

    def residual(self, computed: float) -> float:
        """Return (computed - stated)/tolerance."""
        return (computed - self.fact.value) / self.tolerance


_FILE = SourceFile(Path(__file__).with_name("dardanelli2010_measured.toml"))
_TIME = replace(ALLOWANCES["corner"], what="time constants of Table 4")


def _table4(region: str) -> Iterator[Statement]:
    """Yield a region's row: gain, two time constants, and overshoot."""
    row, model = FACTS.table(f"table4.{region}"), table4_model(region)
    height = FACTS["fig6_step"].value
    _, high = step_peak(model, height)
    where = f"Table 4, {region} pressure"
    yield Statement(f"table4.{region}.K", replace(row["K"], note="step of 0.35 A with dither"))
    for key in ("T1", "T2"):
        corner = row[key].value
        time = Fact(
            1e3 / (2.0 * math.pi * corner),
            "ms",
            f"{where}: 1/(2 pi {corner:g} Hz)",
            tolerance=_TIME,
            note="eq. (21) with that gain, fitted to sines of 0.1 A from 1 to 15 Hz",
        )
        yield Statement(f"table4.{region}.{key}", time)
    overshoot = Fact(
        100.0 * (high / (height * model.gain) - 1.0),
        "%",
        f"{where}, eq. (22)",
        tolerance=ALLOWANCES["overshoot"],
        note="peak of the step response minus its value after 4 s: the effect of the slow "
        "zero-pole pair, to which no parameter of the brake corresponds",
    )
    yield Statement(f"table4.{region}.overshoot", overshoot)


def _statements() -> Iterator[Statement]:
    for region in REGIONS:
        yield from _table4(region)
    for name, fact in FACTS.table("table3").items():
        digit = _FILE.allowances[name]
        yield Statement(f"table3.{name}", replace(fact, tolerance=digit, note="the parameter"))
    ratio = "ratio of the loop area with dither to the area without, averaged over a dither period"
    error = "mean of the last 0.24 s of hard braking minus 37 bar"
    read = _FILE.facts
    for name, fact in (
        ("fig5.p_max", read["fig5.p_max"]),
        ("fig5.i_max", read["fig5.i_max"]),
        ("fig5.loop_area_ratio", replace(FACTS["fig5_loop"], note=ratio)),
        ("fig6.peak", read["fig6.peak"]),
        ("fig7.peak", read["fig7.peak"]),
        ("fig7.steady_state_error", replace(FACTS["steady_state"], note=error)),
    ):
        yield Statement(name, fact)


STATEMENTS = tuple(_statements())
"""every misfit term: (computed - stated)/tolerance"""


def allowances() -> tuple[Allowance, ...]:
    """Return the tolerances in use, without duplicates."""
    return tuple(dict.fromkeys(statement.allowance for statement in STATEMENTS))


# --- Counterparts, computed for many brakes at once
# An ideal converter makes the computed values change smoothly with the parameters.

Par = MotorcycleParameters

_FREQUENCIES = (1.0, 2.0, 4.0, 8.0, 15.0)
"""sines [Hz]; the paper's second step uses 1 to 15 Hz"""
_AMPLITUDE = 0.1
"""amplitude of the sines [A]"""

_BAR, _SUBSTEP = 1e5, 20e-6
_SETTLE, _ROUNDS, _AWAY = 3.0, 3, 1.15  # s; corrections of the current; their starting factor
_WINDOW, _AFTER, _LATE = 2.0, 4.0, 0.6  # s: windows of a sine, of a step, and of the level means
_FIRST, _SECOND = 1.0, 10.0  # Hz: start of the search for T1 and T2
_END = 0.24  # s: window for the end of hard braking


def computed(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return each brake's counterparts of all statements except Table 3's, in the statement's unit.

    Parameters
    ----------
    brakes
        Parameter sets that differ only in numbers, not in choices.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    ideal = [par.replace({"adc.law": "ideal"}) for par in brakes]
    parts = (*(_region(ideal, name) for name in REGIONS), _ramps(ideal), _braking(ideal))
    return [{k: v for part in parts for k, v in part[n].items()} for n in range(len(ideal))]


def _together(runs: Sequence[Run], signals: Sequence[str]) -> Sequence[Trajectory]:
    """Simulate runs side by side where that is possible."""
    if fit_lanes(runs):
        return simulate_group(runs, signals)
    return [simulate(run, signals) for run in runs]


def _sine(i: float, f: float, t: Array) -> Array:
    return np.asarray(i + _AMPLITUDE * np.sin(2.0 * math.pi * f * t))


def _step(before: float, after: float, t: Array) -> Array:
    return np.where(t < -1e-9, before, after)


def _driven(
    par: Par, p: float, demand: Callable[[Array], Array], duration: float, settle: float
) -> Run:
    """Return a run from rest at ``p`` [Pa] with a current demand [A]."""
    case = case_from_rest(
        "run",
        par,
        "current",
        p,
        lambda t: {"i_set": demand(t)},
        duration,
        settle=settle,
        keep=settle,
    )
    return as_run(case, _SUBSTEP)


def _settled(brakes: Sequence[Par], p: float) -> list[float]:
    """Return the frictionless equilibria [Pa] at whose currents each brake settles at ``p``.

    A fixed number of corrections, unlike ``settled_start``, keeps the result smooth.
    """
    starts = np.full(len(brakes), _AWAY * p)
    for _ in range(_ROUNDS):
        holds = [holding_current(start, par) for par, start in zip(brakes, starts, strict=True)]
        runs = [
            _driven(par, start, partial(_sine, i, 0.0), _SETTLE, 0.0)
            for par, start, i in zip(brakes, starts, holds, strict=True)
        ]
        means = [
            run["p_mc"][run.time >= _SETTLE - _LATE - 1e-9][:-1].mean()
            for run in _together(runs, ("p_mc",))
        ]
        starts = starts * p / np.array(means)
    return [float(start) for start in starts]


def _region(brakes: Sequence[Par], name: str) -> list[dict[str, float]]:
    """Return gain, time constants and overshoot of a pressure region, and Fig. 6's peak."""
    p, height = REGIONS[name], FACTS["fig6_step"].value
    starts = _settled(brakes, p)
    holds = [holding_current(start, par) for par, start in zip(brakes, starts, strict=True)]
    every = list(zip(brakes, starts, holds, strict=True))
    steps = _together(
        [
            _driven(par, start, partial(_step, i, i + height), _AFTER, _SETTLE)
            for par, start, i in every
        ],
        ("p_mc",),
    )
    sines = _together(
        [
            _driven(par, start, partial(_sine, i, f), _WINDOW, _WINDOW)
            for par, start, i in every
            for f in _FREQUENCIES
        ],
        ("i", "p_mc"),
    )
    rows = []
    for k, (par, step) in enumerate(zip(brakes, steps, strict=True)):
        mine = zip(sines[k * len(_FREQUENCIES) :], _FREQUENCIES, strict=False)
        before, after, peak = _levels(step, par)
        K = (after - before) / height
        T1, T2 = _time_constants(K, np.array([_line(sine, f) for sine, f in mine]))
        row = {
            "K": K / _BAR,
            "T1": 1e3 * T1,
            "T2": 1e3 * T2,
            "overshoot": 100.0 * (peak - after) / (after - before),
        }
        rows.append({f"table4.{name}.{key}": float(value) for key, value in row.items()})
        if name == "medium":
            rows[-1]["fig6.peak"] = float(FACTS["fig6_start"].value + (peak - before) / _BAR)
    return rows


def overshoots(par: Par, name: str, heights: Sequence[float]) -> list[float]:
    """Return the overshoot [bar] of current steps [A] in a region, above the final value."""
    ideal, p = par.replace({"adc.law": "ideal"}), REGIONS[name]
    (start,) = _settled([ideal], p)
    i = holding_current(start, ideal)
    runs = [_driven(ideal, start, partial(_step, i, i + h), _AFTER, _SETTLE) for h in heights]
    levels = (_levels(step, ideal) for step in _together(runs, ("p_mc",)))
    return [(peak - after) / _BAR for _, after, peak in levels]


def _levels(step: Trajectory, par: Par) -> tuple[float, float, float]:
    """Return the pressure [Pa] before a step, at its end and at its peak, dither averaged out."""
    t = step.time - _SETTLE
    p = _averaged(step, par)
    before, after = (t >= -_LATE) & (t < -0.02), t >= _AFTER - _LATE
    return float(p[before].mean()), float(p[after].mean()), float(p[t > 0.0].max())


def _averaged(run: Trajectory, par: Par) -> Array:
    return smoothed(run.time, run["p_mc"], 1.0 / par.ecu.dither.f_dit)


def _line(sine: Trajectory, f: float) -> complex:
    """Return the response from current to pressure at the sine's frequency [Pa/A]."""
    inside = np.flatnonzero(sine.time >= _WINDOW - 1e-9)[:-1]
    wave = np.exp(-2j * math.pi * f * sine.time[inside])
    pressure, current = (sine[name][inside] @ wave for name in ("p_mc", "i"))
    return complex(pressure / current)


def _time_constants(K: float, lines: Complex) -> tuple[float, float]:
    """Return T1 and T2 of eq. (21) [s] from the sines' magnitude and phase, for a known gain.

    This is the paper's second step; the gain comes from the step response.
    """
    slow, fast = (1.0 / (2.0 * math.pi * f) for f in (_FIRST, _SECOND))
    log_gain = np.log(np.abs(lines)) + 1j * np.unwrap(np.angle(lines))
    points = Points(np.array(_FREQUENCIES), log_gain, np.ones(len(_FREQUENCIES)))
    region = Region("", (), points, 0.0)
    unknowns = unknowns_of(region, {"K": K, "tau_L": 1.0, "T1": slow, "T2": fast, "T_L": 1.0})
    whole = over_frequency(region, unknowns)
    problem = restricted(whole, (2, 3), np.array([u.start for u in unknowns]))
    T = np.sort(solve(problem, np.array([slow, fast])).values)
    return float(T[1]), float(T[0])


def _ramps(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return the counterparts of Fig. 5 on the ramp (17)."""
    options = friction_ramp.Options.model_validate(friction_ramp.EXPERIMENT.defaults.model_dump())
    pairs = [friction_ramp.cases(par, options) for par in brakes]
    both = [_runs((pair[k] for pair in pairs), ("i_meas", "p_mc")) for k in (0, 1)]
    rows = []
    for par, *runs in zip(brakes, *both, strict=True):
        currents = [_low_passed(run, options.f_filter) for run in runs]
        without, dithered = (
            loop_area(
                Loop(
                    run.time, smoothed(run.time, i, 1.0 / par.ecu.dither.f_dit), _averaged(run, par)
                )
            ).value
            for run, i in zip(runs, currents, strict=True)
        )
        rows.append(
            {
                "fig5.p_max": max(float(run["p_mc"].max()) for run in runs) / _BAR,
                "fig5.i_max": max(float(i.max()) for i in currents),
                "fig5.loop_area_ratio": 100.0 * dithered / without,
            }
        )
    return rows


def stuck_at(par: Par) -> float:
    """Return the maximum pressure [bar] of the ramp (17) without dither."""
    options = friction_ramp.Options.model_validate(friction_ramp.EXPERIMENT.defaults.model_dump())
    without = friction_ramp.cases(par.replace({"adc.law": "ideal"}), options)[0]
    return float(_runs([without], ("p_mc",))[0]["p_mc"].max()) / _BAR


def _runs(cases: Iterable[Case], signals: Sequence[str]) -> Sequence[Trajectory]:
    return _together([as_run(case, _SUBSTEP) for case in cases], signals)


def _low_passed(run: Trajectory, f: float) -> Array:
    """Return the measured current after the first-order low-pass filter of Fig. 5."""
    return low_passed(run["i_meas"], f, float(run.time[1] - run.time[0]))


def _braking(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return the counterparts of Fig. 7a in hard braking."""
    options = hard_braking.Options.model_validate(hard_braking.EXPERIMENT.defaults.model_dump())
    runs = _runs((hard_braking.cases(par, options)[0] for par in brakes), ("p_mc",))
    rows = []
    for par, run in zip(brakes, runs, strict=True):
        late = run.time >= run.time[-1] - _END + 1e-9
        rows.append(
            {
                "fig7.peak": float(_averaged(run, par).max()) / _BAR,
                "fig7.steady_state_error": float(run["p_mc"][late].mean() - options.p_to) / _BAR,
            }
        )
    return rows


# --- All free parameters from all statements together

PRIOR = PRINTED
"""set of the starting values and of the undetermined parameters: Table 1 as printed"""
P_NOMINAL = 20e5
"""pressure [Pa] at which the piston is at its nominal position, as in the other sets"""

_TENFOLD = "0.1 to 10 times Table 1: a value outside belongs to a different brake"
_TABLE3 = "0.2 to 5 times Table 3"


@dataclass(frozen=True)
class _Free:
    """A free parameter: bounds [SI], their reason, and its magnitude if it may be zero."""

    low: float
    high: float
    reason: str
    scale: float = 0.0


FREE: Mapping[str, _Free] = {
    "master_cylinder.A_mc": _Free(0.4e-4, 3e-4, "bores of 7 to 20 mm"),
    "gear.eta_g": _Free(0.5, 1.0, "ball screw and gear: output energy <= input energy"),
    "gear.J_mot": _Free(2e-6, 2e-4, "a motor of 20 to 80 mm"),
    "master_cylinder.k_damp": _Free(0.0, 2e5, "zero to ten times Table 1"),
    "caliper.K_pd": _Free(1e5, 1e7, _TENFOLD),
    "fluid.V_air": _Free(
        0.0, 6e-7, "zero to the maximum volume that fits the nominal position", 1e-7
    ),
    "master_cylinder.s_mc": _Free(15.5e-3, 60e-3, "end stop to three times our choice"),
    "seal.T_pr": _Free(0.0, 3e-2, "zero to Fig. 4's torque at low pressure"),
    "seal.f_cfr_p": _Free(3.2e-9, 8e-8, _TABLE3),
    "seal.f_cfr_n": _Free(1.08e-9, 2.7e-8, _TABLE3),
    "seal.k_brk_p": _Free(1.0, 13.0, "Coulomb friction to five times Table 3"),
    "seal.k_brk_n": _Free(1.0, 11.5, "Coulomb friction to five times Table 3"),
    "seal.c": _Free(1.0, 25.0, _TABLE3),
    "seal.mu_T": _Free(0.0, 2e-3, "zero to the text's 1e-2 N·m·s/rad, instead of Table 3's", 2e-7),
    "ecu.filter.zeta": _Free(0.3, 1.5, "second-order low-pass filters in use"),
}
"""parameters that the fit estimates together"""

TIED: Mapping[str, str] = {
    "ecu.est_par.T_pr": "seal.T_pr",
    "ecu.est_par.f_cfr_p": "seal.f_cfr_p",
    "ecu.est_par.k_brk_p": "seal.k_brk_p",
}
"""friction that the ECU assumes for the dither, and the parameter that has the same value"""

HELD: Mapping[str, str] = {
    "gear.k_g": "acts only through A_mc k_g, k_damp k_g^2 and the chamber's volume, which A_mc, "
    "k_damp and s_mc represent",
    "gear.M_mc": "adds to the inertia, which J_mot represents",
    "motor.K_e": "acts through eta_g K_e, which eta_g represents, and hardly through the back-EMF",
    "caliper.A_pd": "acts only through A_pd^2/K_pd, which K_pd represents",
    "fluid.beta": "acts only through the chamber's volume/beta ratio, which s_mc represents",
    "pipeline.d_pl": "the misfit falls as the pipeline gets wider, until its resistance is "
    "negligible and the misfit no longer depends on d_pl, so the published values determine only "
    "a lower bound",
    "fluid.nu": "acts only through the pipeline's resistance, as d_pl does",
    "fluid.rho": "acts only through the pipeline's resistance, as d_pl does",
    "pipeline.L_pl": "acts only through the pipeline's resistance, as d_pl does",
    "pipeline.k_lf": "acts only through the pipeline's resistance, as d_pl does",
}
"""parameters fixed at their value in Table 1, with the reason: most of them act only in a product
with a free parameter"""


def prior() -> Par:
    """Return the start of the search: Table 1 as printed, with entrained air switched on."""
    return parameters(PRIOR).replace({"fluid.air": "entrained", "fluid.V_air": 0.0})


def unknowns() -> tuple[Unknown, ...]:
    """Return the free parameters as unknowns within their bounds, starting at Table 1."""
    known, fields = prior().leaves(), leaf_fields(Par)
    return tuple(
        Unknown(
            name,
            known[name],
            free.low,
            free.high,
            free.scale or known[name],
            fields[name].unit.symbol,
        )
        for name, free in FREE.items()
    )


def brake(values: Mapping[str, float]) -> Par:
    """Return the brake with some free parameters changed and the others as in Table 1.

    The retracted end is adjusted so that the piston is at its nominal position at 20 bar. The
    friction that the ECU assumes is adjusted, too.

    Parameters
    ----------
    values
        Changed values by name, SI.

    Raises
    ------
    ParameterError
        When a value is out of range, or the stroke to 20 bar is longer than the nominal travel.
    """
    tied = {name: values[source] for name, source in TIED.items() if source in values}
    near = prior().replace({**values, **tied})
    nominal = near.master_cylinder.x_nominal
    x_rest = near.master_cylinder.x_rest
    for _ in range(
        20
    ):  # the travel hardly depends on the volume behind it, so a few iterations are enough
        missing = nominal - travel_at(P_NOMINAL, near)
        x_rest += missing
        if not x_rest > 0.0:
            limit = f"< {nominal * 1e3:g} mm"
            raise ParameterError(
                f"the stroke to {P_NOMINAL / 1e5:g} bar must be {limit}, the nominal travel. "
                "Reduce fluid.V_air, or increase caliper.K_pd or master_cylinder.A_mc",
                name="stroke",
                valid=limit,
            )
        near = near.replace({"master_cylinder.x_rest": x_rest})
        if abs(missing) < 1e-12:
            break
    return near


# --- The misfit

LOSS: Loss = "soft_l1"
"""weight of large residuals: the statements contradict each other, so with squares the largest
residual would dominate"""
_STEP = 0.01
"""difference step relative to an unknown's scale: larger steps add the gain's curvature, smaller
steps add roughness from stick-slip"""
_PARTS = tuple(Part(s.name, "", 1, s.fact.unit, s.tolerance) for s in STATEMENTS)
"""one part per residual"""

_RESOLVED = 1e-4  # relative to the misfit: smaller changes are roughness from stick-slip


def predicted(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return each brake's counterpart of every statement, by the statement's name, in its unit.

    Parameters
    ----------
    brakes
        Parameter sets that differ only in numbers, not in choices.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    rows = computed(brakes)
    for par, row in zip(brakes, rows, strict=True):
        row |= {f"table3.{name}": float(value) for name, value in par.seal.flat().items()}
    return [{s.name: row[s.name] for s in STATEMENTS} for row in rows]


def residuals(brakes: Sequence[Par]) -> Array:
    """Return (computed - stated)/tolerance, shape (brakes, statements)."""
    return np.array([[s.residual(row[s.name]) for s in STATEMENTS] for row in predicted(brakes)])


def problem(free: tuple[Unknown, ...] | None = None) -> Problem:
    """Return the misfit as a function of the free parameters.

    Derivatives are central differences, one-sided at the bounds. All brakes that they require are
    computed side by side.

    Parameters
    ----------
    free
        Unknowns. Default: all of them.
    """
    free = unknowns() if free is None else free
    last: dict[bytes, tuple[Array, Array]] = {}  # a fixed parameter needs no additional runs

    def evaluate(values: Array) -> tuple[Array, Array]:
        if (key := values.tobytes()) not in last:
            result = simulated(values)
            last.clear()
            last[key] = result
        return last[key]

    def simulated(values: Array) -> tuple[Array, Array]:
        try:
            r, lower, upper, ends = _around(free, values)
        except (
            ParameterError
        ) as error:  # the trial step was too long: the search uses a shorter one
            raise SolverError(str(error)) from error
        return r, slopes(values, r, lower, upper, ends)

    return Problem(free, evaluate, parts=_PARTS, resolved=_RESOLVED)


def slopes(values: Array, r: Array, lower: Array, upper: Array, ends: tuple[Array, Array]) -> Array:
    """Return the residuals' derivatives from both sides, shape (statements, unknowns).

    Where a statement has no counterpart on one side, such as a loop's area when the piston sticks,
    the derivative is one-sided.
    """
    sides = []
    for side, end in zip((lower, upper), ends, strict=True):
        is_defined = np.isfinite(side)
        at = np.where(is_defined, end[:, None], values[:, None])
        sides.append((np.where(is_defined, side, r), at))
    (below, low), (above, high) = sides
    with np.errstate(invalid="ignore"):  # undefined on both sides: 0/0, NaN
        return np.asarray(((above - below) / (high - low)).T)


def _around(
    free: Sequence[Unknown], values: Array
) -> tuple[Array, Array, Array, tuple[Array, Array]]:
    """Return the residuals here, one step below and one above in each unknown, and the steps."""
    size = _STEP * np.array([u.scale for u in free])
    low, high = (np.array([getattr(u, end) for u in free]) for end in ("low", "high"))
    ends = np.maximum(values - size, low), np.minimum(values + size, high)
    rows = [values]
    for end in ends:
        rows += list(np.where(np.eye(values.size, dtype=bool), end, values))
    r = residuals([brake(_named(free, row)) for row in rows])
    lower, upper = r[1 : 1 + values.size], r[1 + values.size :]
    return r[0], lower, upper, ends


def _named(free: Sequence[Unknown], values: Array) -> Mapping[str, float]:
    return {u.name: float(v) for u, v in zip(free, values, strict=True)}


def misfit(r: Array) -> float:
    """Return the fit's cost: half the sum of the losses of residuals in tolerances."""
    return 0.5 * float(rho(r**2, LOSS)[0].sum())


def _sized(values: Array) -> tuple[Unknown, ...]:
    """Return the unknowns, each scaled by the larger of its prior and its estimate."""
    return tuple(
        replace(u, scale=max(u.scale, abs(float(v))))
        for u, v in zip(unknowns(), values, strict=True)
    )


# --- Uncertainty of a brake that is treated as the best


def appraised(par: Par) -> Appraisal:
    """Return the uncertainty of a brake's free parameters, which must minimize the misfit.

    Parameters that the statements do not determine are treated as fixed at their values.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    values = np.array([par.leaves()[u.name] for u in unknowns()])
    free = moved(_sized(values), values)
    r, lower, upper, ends = _around(free, values)
    J = slopes(values, r, lower, upper, ends)
    best = estimate(Problem(free, lambda _: (r, J), parts=_PARTS), LOSS, values, search=False)
    determined = [[u.name for u in free].index(name) for name in best.names]
    scale = np.array([u.scale for u in best.unknowns])
    beside = np.stack((lower[determined], upper[determined]))
    return Appraisal(best, r, J[:, determined] * scale, beside)


@dataclass(frozen=True)
class Appraisal:
    """A brake's free parameters as an estimate.

    Parameters
    ----------
    estimate
        The p parameters that the statements determine, with intervals, and the others.
    residuals
        Residuals in tolerances, shape (statements,).
    jacobian
        Derivatives of the residuals by the p parameters, each in its scale, shape (statements, p).
    beside
        Residuals with each parameter lower or higher by 1 % of its scale, shape (2, p, statements).
    """

    estimate: Estimate
    residuals: Array
    jacobian: Array
    beside: Array

    @property
    def computed(self) -> dict[str, float]:
        """Counterpart of every statement by the statement's name, in its unit."""
        rows = zip(STATEMENTS, self.residuals, strict=True)
        return {s.name: s.fact.value + s.tolerance * float(r) for s, r in rows}

    @property
    def misfit(self) -> float:
        """The cost: half the sum of the losses."""
        return misfit(self.residuals)

    def gain(self) -> float:
        """Return the misfit's maximum relative reduction by a 1 % step in one parameter.

        At a minimum only the roughness from stick-slip remains.
        """
        misfits = [misfit(r) for side in self.beside for r in side]
        return 1.0 - float(np.nanmin(misfits)) / self.misfit

    def deciding_statements(self, name: str, most: int = 3) -> tuple[str, ...]:
        """Return the statements whose shift by one tolerance changes a parameter most.

        Parameters
        ----------
        name
            Name of the parameter.
        most
            Maximum number of statements. The function omits statements with less than a third of
            the first one's effect.
        """
        _, steep = influence(self.residuals, LOSS)
        weighed = self.jacobian * steep[:, None]
        moved = np.linalg.pinv(self.jacobian.T @ weighed) @ weighed.T
        row = np.abs(moved[self.estimate.names.index(name)])
        order = [k for k in np.argsort(-row)[:most] if row[k] > row.max() / 3.0]
        return tuple(STATEMENTS[k].name for k in order)


# --- The search

_SPREAD = 0.3
"""maximum distance of the other starts from Table 1, relative to Table 1"""

_SEARCHES = 6  # rounds of fixing parameters and searching: two were enough


def estimated(
    starts: int = 6, seed: int = 1, *, progress: Progress | None = None, store: Path | None = None
) -> Estimate:
    """Return the free parameters that explain the statements best.

    At the end of the best search, the least determined parameter returns to Table 1. The search
    continues without this parameter until the data determine all others. Then a search with all
    parameters free follows, and `settled`. Parameters that the statements do not determine stay at
    Table 1; the result lists them with the reason.

    Parameters
    ----------
    starts
        Number of starts: Table 1, then others around it.
    seed
        Seed of their random numbers.
    progress
        Called with a label and the finished fraction.
    store
        File that stores every finished start.

    Returns
    -------
    Estimate
        Values [SI] with covariance; residuals in tolerances, in the order of `STATEMENTS`.

    Raises
    ------
    SolverError
        When no start reaches a minimum.
    """
    begin = scattered(unknowns(), starts, _SPREAD, seed)
    led = search(problem(), begin, LOSS, progress, store)
    first = estimate(problem(_sized(led.best.values)), LOSS, led.best.values)
    table1 = {u.name: u.start for u in unknowns()}
    values = table1 | dict(zip(first.names, first.values.tolist(), strict=True))
    best = settled(_searched(np.array([values[name] for name in table1]), ())).estimate
    return best.noted((f"{led.reached} of {starts} starts reached the lowest minimum",))


def settled(values: Array) -> Appraisal:
    """Return the nearby minimum whose undetermined parameters are at Table 1.

    The brake decides which parameters the statements determine. So the undetermined parameters
    return to Table 1, and the search repeats for the others, until the minimum's undetermined
    parameters are the fixed ones. If that never happens, the lowest minimum counts.

    Parameters
    ----------
    values
        All free parameters, in the order of `unknowns`, SI.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    appraisals: list[Appraisal] = []
    held_before: list[tuple[int, ...]] = []
    for _ in range(_SEARCHES):
        here = appraised(brake(_named(unknowns(), values)))
        appraisals.append(here)
        held = _undetermined(here)
        if held in held_before:
            break
        held_before.append(held)
        values = _searched(values, held)
    return min(appraisals[1:], key=lambda appraisal: appraisal.misfit)


def _searched(values: Array, held: tuple[int, ...]) -> Array:
    """Return the nearby minimum with the unknowns at some indices fixed at Table 1."""
    table1 = np.array([u.start for u in unknowns()])
    free = np.setdiff1d(np.arange(values.size), held)
    begin = np.where(np.isin(np.arange(values.size), held), table1, values)
    whole = problem(moved(_sized(values), begin))
    for index in sorted(held, reverse=True):
        whole = whole.held(index)
    end = begin.copy()
    end[free] = solve(whole, begin[free], LOSS).values
    return end


def _undetermined(here: Appraisal) -> tuple[int, ...]:
    """Return the indices of the parameters that the statements do not determine."""
    names = [u.name for u in unknowns()]
    return tuple(sorted(names.index(kept.unknown.name) for kept in here.estimate.kept))
