"""The hand-written C of the wedge brake against bywire's own runs.

Both schemes are implicit midpoint with set-valued friction, of second order; bywire takes bounds
and contacts at the predicted midpoint once, the C iterates them. What they differ by falls with the
square of the step, and at 20 us it is 1/100 of what either differs from the exact solution.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.peers.hand_code import WITHOUT_SUMS, Call
from benchmarks.wedge import wedge_brake
from benchmarks.wedge.hand_wedge import SUBJECT, HandWrittenWedge
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.simulation.compiler import SINGLE, find_compiler
from bywire.simulation.run import Run, Trajectory, simulate

Array = NDArray[np.float64]

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

IDEAL = {"encoder.law": "ideal"}
SHORT_STEP = 2.5e-6
# Shares of a signal's largest value; frictions at the instant of sticking differ most, 4e-5. Where
# the tips meet, limits are reached or the disc stops within a substep, smaller steps are needed:
# 3e-4 at 2.5 us.
TOLERANCE, WITH_EVENTS = 1e-4, 1e-3


def brake(changes: Mapping[str, Any] | None = None) -> WedgeParameters:
    par = parameters("roberts2003").replace(dict(changes or {}))
    assert isinstance(par, WedgeParameters)
    return par


def from_parked(
    changes: Mapping[str, Any],
    moments: Mapping[float, float],
    off: float = 9.0,
    step: float = 20e-6,
) -> Run:
    """Return half a second with moment demands [N m] from instants [s] on, then the power off."""
    par, fields = brake(IDEAL | dict(changes)), WedgeBrake.Stimulus._fields

    def stimulus(t: Array) -> Array:
        rows = np.zeros((t.size, len(fields)))
        for instant, moment in moments.items():
            rows[t >= instant - 1e-9, fields.index("M_set")] = moment
        rows[t >= off - 1e-9, fields.index("power_off")] = 1.0
        return rows

    return Run(WedgeBrake(), par, state_at(0.0, par), memory_at(0.0, par), stimulus, 0.5, step)


PULSE = {0.01: 400.0, 0.3: 0.0}
RUNS = {
    "fig. 7": lambda: wedge_brake.fig7(brake(IDEAL)),
    "release": lambda: from_parked({}, PULSE),
    "backward": lambda: from_parked({"flywheel.Omega_0": -60.0}, PULSE),
    "power off": lambda: from_parked({}, PULSE, off=0.2),
    "end stop": lambda: from_parked({"wedge.x_stop": 7e-4}, PULSE),
    "low voltage": lambda: from_parked({"drive.V_dc": 8.0}, PULSE, step=SHORT_STEP),
    "current limit": lambda: from_parked({"drive.i_max": 4.0}, PULSE, step=SHORT_STEP),
    "tips": lambda: from_parked({"control.offset.delta_preload": -20e-6}, PULSE, step=SHORT_STEP),
    "disc that stops": lambda: from_parked({"flywheel.J_F": 1.0}, PULSE, step=SHORT_STEP),
}


@cache
def both(name: str) -> tuple[Trajectory, Call]:
    run = RUNS[name]()
    call = HandWrittenWedge(run.par).single(run)  # type: ignore[arg-type]
    assert call() > 0.0
    return simulate(run), call


def differences(ours: Trajectory, call: Call) -> dict[str, float]:
    """Return the largest difference of every output, share of its largest value."""
    return {
        name: float(np.abs(call[name][0] - ours[name]).max() / (np.abs(ours[name]).max() or 1.0))
        for name in ours.names
    }


@pytest.mark.parametrize("name", RUNS)
def test_every_output_agrees(name: str) -> None:
    ours, call = both(name)
    assert ours.names == SUBJECT.outputs
    assert (ours.unsettled, call.unsettled) == (0, 0)
    tolerance = TOLERANCE if RUNS[name]().step > SHORT_STEP else WITH_EVENTS
    assert {n: d for n, d in differences(ours, call).items() if not d < tolerance} == {}


def test_runs_meet_what_they_are_named_for() -> None:
    """The comparison above is worth something on every branch of the C."""
    assert set(both("release")[0]["mode"]) == {0.0, 1.0, 2.0, 3.0}
    assert both("backward")[0]["x"].min() < -5e-4
    assert np.ptp(both("power off")[0]["voltage_1"]) > 5.0
    assert np.all(both("power off")[0]["i_1"][-100:] == pytest.approx(0.0, abs=1e-9))
    assert both("low voltage")[0]["voltage_1"].max() == 8.0
    assert both("current limit")[0]["i_1_ref"].max() > 4.5
    assert both("tips")[0]["f_12"].max() > 50.0
    assert both("end stop")[0]["F_end"].max() > 100.0
    assert both("disc that stops")[0]["Omega"][-1] == 0.0


def test_difference_falls_with_the_square_of_the_step() -> None:
    """What is not the same to rounding: where motion turns, the two take other ways.

    Less than half of what either is off, and of second order where it does not hang on turns.
    """
    states, others = ("x", "omega_1", "i_1"), ("T_fr_1", "P_meas", "E_shaft")

    def both(step: float) -> tuple[Array, Array]:
        run = wedge_brake.fig7(brake(IDEAL), step)
        call = HandWrittenWedge(run.par).single(run)  # type: ignore[arg-type]
        call()
        ours = simulate(run)
        pairs = [(call[n][0], ours[n]) for n in (*states, *others)]
        return tuple(np.array(side) for side in zip(*pairs, strict=True))  # type: ignore

    def rms(values: Array) -> Array:
        return np.sqrt(np.mean(values**2, axis=1))

    _, exact = both(1e-6)
    differences = []
    for step in (20e-6, 10e-6):
        hand, ours = both(step)
        differences.append(rms(hand - ours))
        assert np.all(differences[-1][:3] < 0.5 * rms(ours - exact)[:3])
    np.testing.assert_allclose((differences[0] / differences[1])[3:], 4.0, atol=0.25)


@pytest.mark.parametrize(
    "name", ["wedge_friction.mu_int", "bearing.G_S", "heart.tau_heart", "motor_2.J_M"]
)
def test_a_slip_of_one_per_cent_would_show(name: str) -> None:
    right = brake(IDEAL)
    wrong = wedge_brake.fig7(brake(IDEAL | {name: right.leaves()[name] * 1.01}))
    call = HandWrittenWedge(right).single(wrong)
    call()
    assert max(differences(both("fig. 7")[0], call).values()) > 2.0 * TOLERANCE


def test_counting_encoders_differ_by_a_count() -> None:
    """Rounding makes whole counts of the smallest differences: one count of travel remains."""
    run = wedge_brake.fig7(brake())
    call = HandWrittenWedge(run.par).single(run)  # type: ignore[arg-type]
    call()
    par = brake()
    count = par.screw.lead / par.encoder.counts
    np.testing.assert_allclose(call["x"][0], simulate(run)["x"], rtol=0.0, atol=count)


def test_ensemble_equals_single_runs() -> None:
    cases = [brake(IDEAL | {"wedge.mu_B": mu}) for mu in (0.3, 0.35, 0.4)]
    run = from_parked({}, PULSE)
    library = HandWrittenWedge(cases[0], (*SINGLE, *WITHOUT_SUMS))
    together = library.ensemble(run, cases, ("y_M", "x"))
    together()
    for k, par in enumerate(cases):
        alone = HandWrittenWedge(par).single(from_parked({"wedge.mu_B": par.wedge.mu_B}, PULSE))
        alone()
        np.testing.assert_allclose(together["y_M"][k], alone["y_M"][0], rtol=1e-12)
        np.testing.assert_allclose(together["x"][k], alone["x"][0], rtol=1e-12)


def test_every_choice_is_named() -> None:
    par = brake()
    texts = {name for name, value in par.flat().items() if isinstance(value, str)}
    assert {name for name in texts if not name.startswith("rig.")} == set(SUBJECT.choices)
    with pytest.raises(ValueError, match=r"screw\.law = 'drive'"):
        HandWrittenWedge(par.replace({"screw.law": "drive"}))
