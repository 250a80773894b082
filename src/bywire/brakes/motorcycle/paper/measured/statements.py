"""Measured statements of the paper with tolerances, and their counterparts in simulation.

Table 1 and Table 2 are theory and data sheets, so they do not count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
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
from bywire.brakes.motorcycle.paper.table4 import step_peak
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.typing import Array, Complex
from bywire.data.recursive_filter import low_passed
from bywire.identification.least_squares import solve
from bywire.reproduction.item import Allowance, Fact
from bywire.reproduction.source_file import SourceFile
from bywire.simulation.ensemble import fit_lanes, simulate_group
from bywire.simulation.run import Run, Trajectory, simulate


@dataclass(frozen=True)
class Statement:
    """A measured number of the paper.

    Parameters
    ----------
    name
        Name of the statement, and of its counterpart in ``computed``.
    fact
        Number and place of the statement, its tolerance, and the computation of its counterpart.
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


_FILE = SourceFile(Path(__file__).parents[1] / "dardanelli2010_measured.toml")
_TIME = replace(ALLOWANCES["corner"], what="time constants of Table 4")


def _table4(region: str) -> Iterator[Statement]:
    """Yield the row of a region: gain, two time constants, and overshoot."""
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
            note="eq. (21) with that gain, fitted to sines of 0.1 A, 1 to 15 Hz",
        )
        yield Statement(f"table4.{region}.{key}", time)
    overshoot = Fact(
        100.0 * (high / (height * model.gain) - 1.0),
        "%",
        f"{where}, eq. (22)",
        tolerance=ALLOWANCES["overshoot"],
        note="highest point of the step minus its value after 4 s: the effect of "
        "the slow pair, whose zero and pole have no counterpart",
    )
    yield Statement(f"table4.{region}.overshoot", overshoot)


def _statements() -> Iterator[Statement]:
    for region in REGIONS:
        yield from _table4(region)
    for name, fact in FACTS.table("table3").items():
        digit = _FILE.allowances[name]
        yield Statement(f"table3.{name}", replace(fact, tolerance=digit, note="the parameter"))
    ratio = "area of the loop with dither over the area without, averaged over a dither period"
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
    """Return the tolerances in use, each once."""
    return tuple(dict.fromkeys(statement.allowance for statement in STATEMENTS))


# --- Counterparts, computed for many brakes at once
# An ideal converter makes the computed values change smoothly with the parameters.

Par = MotorcycleParameters

_FREQUENCIES = (1.0, 2.0, 4.0, 8.0, 15.0)
"""sines [Hz]; the paper's second step reaches from 1 to 15 Hz"""
_AMPLITUDE = 0.1
"""of the sines [A]"""

_BAR, _SUBSTEP = 1e5, 20e-6
_SETTLE, _ROUNDS, _AWAY = 3.0, 3, 1.15  # s; corrections of the current; their start
_WINDOW, _AFTER, _LATE = 2.0, 4.0, 0.6  # s: of a sine, of a step, and for the means of levels
_FIRST, _SECOND = 1.0, 10.0  # Hz: start of the search for T1 and T2
_END = 0.24  # s: window for the end of hard braking


def computed(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return each brake's counterparts of all statements but Table 3's, in the statement's unit.

    Parameters
    ----------
    brakes
        Parameter sets of one structure: they may differ only in numbers.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    ideal = [par.replace({"adc.law": "ideal"}) for par in brakes]
    parts = (*(_region(ideal, name) for name in REGIONS), _ramps(ideal), _braking(ideal))
    return [{k: v for part in parts for k, v in part[n].items()} for n in range(len(ideal))]


def _together(runs: Sequence[Run], signals: Sequence[str]) -> Sequence[Trajectory]:
    """Return runs side by side where that is possible."""
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
    """Return a run from rest at ``p`` [Pa] under a current demand [A]."""
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
    """Return the equilibria [Pa] without friction whose currents let each brake settle at p.

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
    """Return gain, time constants and overshoot of a pressure region; Fig. 6's peak."""
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
    """Return the pressure [Pa] before a step, at its end, and its highest, dither averaged."""
    t = step.time - _SETTLE
    p = _averaged(step, par)
    before, after = (t >= -_LATE) & (t < -0.02), t >= _AFTER - _LATE
    return float(p[before].mean()), float(p[after].mean()), float(p[t > 0.0].max())


def _averaged(run: Trajectory, par: Par) -> Array:
    return smoothed(run.time, run["p_mc"], 1.0 / par.ecu.dither.f_dit)


def _line(sine: Trajectory, f: float) -> complex:
    """Return pressure over current at the sine's frequency [Pa/A]."""
    inside = np.flatnonzero(sine.time >= _WINDOW - 1e-9)[:-1]
    wave = np.exp(-2j * math.pi * f * sine.time[inside])
    pressure, current = (sine[name][inside] @ wave for name in ("p_mc", "i"))
    return complex(pressure / current)


def _time_constants(K: float, lines: Complex) -> tuple[float, float]:
    """Return T1 and T2 of eq. (21) [s] from magnitude and phase at the sines, for a known gain.

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
    """Return the counterparts of Fig. 5, the ramp (17)."""
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
    """Return the highest pressure [bar] of the ramp (17) without dither."""
    options = friction_ramp.Options.model_validate(friction_ramp.EXPERIMENT.defaults.model_dump())
    without = friction_ramp.cases(par.replace({"adc.law": "ideal"}), options)[0]
    return float(_runs([without], ("p_mc",))[0]["p_mc"].max()) / _BAR


def _runs(cases: Iterable[Case], signals: Sequence[str]) -> Sequence[Trajectory]:
    return _together([as_run(case, _SUBSTEP) for case in cases], signals)


def _low_passed(run: Trajectory, f: float) -> Array:
    """Return the measured current after the first-order low-pass of Fig. 5."""
    return low_passed(run["i_meas"], f, float(run.time[1] - run.time[0]))


def _braking(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return the counterparts of Fig. 7a, hard braking."""
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
