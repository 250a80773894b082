"""Stops of the two-wheeler against an event-driven reference of the same vehicle.

Both solve the same equations, the engine in steps of 20 us, the reference from event to event. A
deflection that passes its limit for the engine's 0.1 ms has no force beyond it, so that what stays
between them is the error of a step: under 1 um and 1 um/s, rims that lock 4 um/s. The bounds are
ten times that, for other compilers; mistakes of the size below show a hundred times as large.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.simulation.run import Run, Trajectory, simulate
from reference.two_wheeler import (
    PERIOD,
    SlipControl,
    Stop,
    Surface,
    TwoWheeler,
    Wheel,
    controlled,
    stop,
)

WET = Surface(0.857, 33.822, 0.347)
DRY = Surface(1.2801, 23.99, 0.52)
RIDER = 4e6  # Pa, on both brakes
RATE = 2e7  # Pa/s, of a controlled demand
UNCONTROLLED = {"ecu.abs": "off", "ecu.lift": "off", "ecu.p_rate": 1e12}
CONTROLLED = {
    "ecu.abs": "pi",
    "ecu.lift": "off",
    "ecu.p_rate": RATE,
    "ecu.sees": "known",
    "sensors.encoder.law": "ideal",
}
BESIDE = 3e-3  # s about an instant at which a wheel locks: its speed there is that of a step
CLOSE = {"x": 1e-5, "v": 2e-5, "front": 5e-5, "rear": 5e-5}  # m, m/s


def run_of(
    experiment: str, surface: str, options: Mapping[str, float], overrides: Mapping[str, Any]
) -> Run:
    chosen = {"surface": surface} if experiment == "straight-stop" else {}
    bench = Bench(experiment, "sport600", overrides=overrides, options={**options, **chosen})
    return as_run(bench.cases()[0], bench.step)


def vehicle_of(run: Run, surface: Surface) -> TwoWheeler:
    """Return the reference's vehicle with the numbers of a parameter set."""
    par = run.par
    assert isinstance(par, TwoWheelerParameters)
    parts, body = par.vehicle, par.vehicle.body.model_dump()
    assert body["load"] == "lagged"
    wheels = [
        Wheel(
            J=wheel.J,
            r=wheel.r,
            C_rr=wheel.C_rr,
            sigma=tyre.sigma,
            c_t=tyre.c_t,
            v_low=tyre.v_low,
            k=brake.disc.faces * brake.disc.mu_pad * brake.disc.A_cal * brake.disc.r_eff,
        )
        for wheel, tyre, brake in (
            (parts.front_wheel, parts.front_tyre, par.front),
            (parts.rear_wheel, parts.rear_tyre, par.rear),
        )
    ]
    names = ("m", "g", "L", "h", "h_a", "l_f", "CdA", "rho", "tau_N")
    shared = {name: body[name] for name in names}
    circuit = par.front.circuit
    assert par.rear.circuit == circuit
    return TwoWheeler((wheels[0], wheels[1]), surface, **shared, f_n=circuit.f_n, zeta=circuit.zeta)


def demanded(rate: float) -> Any:
    """Return the rider's demand on both brakes without control, ramped [Pa/s] as the ECU does."""
    return lambda tick, y: (min(RIDER, rate * PERIOD * (tick + 1)),) * 2


@dataclass(frozen=True)
class Scene:
    """A stop: what is run, and what the reference says of it."""

    experiment: str
    surface: str
    options: dict[str, float]
    overrides: dict[str, Any]
    reference: Stop

    def simulated(self, **changes: Any) -> Trajectory:
        result = simulate(
            run_of(self.experiment, self.surface, self.options, self.overrides | changes)
        )
        assert result.status == "done"
        return result


def scene(
    experiment: str, surface: str, overrides: dict[str, Any], v: float, duration: float
) -> Scene:
    options = {"v_0": v, "p_front": RIDER, "p_rear": RIDER, "duration": duration}
    run = run_of(experiment, surface, options, overrides)
    par = run.par
    assert isinstance(par, TwoWheelerParameters)
    bike = vehicle_of(run, WET if surface.startswith("wet") else DRY)
    if par.ecu.abs == "pi":
        own = par.ecu.front_slip
        control = SlipControl(own.slip_set, own.omega_c, own.T_i, own.T_t, own.v_off, own.v_fall)
        demand = controlled(bike, control, RIDER, par.ecu.p_rate)
    else:
        demand = demanded(par.ecu.p_rate)
    return Scene(experiment, surface, options, overrides, stop(bike, demand, v, duration))


@pytest.fixture(scope="module")
def locked() -> Scene:
    return scene("straight-stop", "wet-asphalt", UNCONTROLLED, 30.0, 6.4)


@pytest.fixture(scope="module")
def held() -> Scene:
    return scene("straight-stop", "wet-asphalt", CONTROLLED, 30.0, 4.0)


@pytest.fixture(scope="module")
def slow() -> Scene:
    return scene("slow-stop", "dry-asphalt", {}, 3.0, 0.8)


def apart(result: Trajectory, reference: Stop, until: float = np.inf) -> dict[str, float]:
    """Return the largest differences [m, m/s] until a time [s].

    Those of the wheels are speeds at their rims, away from the instants at which they lock.
    """
    t, states = reference.t, reference.states
    before = t < until
    calm = before.copy()
    for at, what in reference.changes:
        if what.endswith(("stands", "rolls")):
            calm &= np.abs(t - at) > BESIDE

    def most(name: str, where: NDArray[np.bool_]) -> float:
        return float(np.abs(result[name] - states[name])[where].max())

    return {
        "x": most("x", before),
        "v": most("v", before),
        "front": 0.30 * most("omega_f", calm),
        "rear": 0.31 * most("omega_r", calm),
    }


def above(found: Mapping[str, float], bounds: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in found.items() if not value <= bounds[name]}


def end_of(result: Trajectory) -> tuple[float, float]:
    """Return time and distance of the first standstill, between the rows about it."""
    v, x, t = result["v"], result["x"], result.time
    i = int(np.argmax(v <= 0.0))
    share = v[i - 1] / (v[i - 1] - v[i])
    return float(t[i - 1] + share * PERIOD), float(x[i - 1] + share * (x[i] - x[i - 1]))


def test_locked_stop(locked: Scene) -> None:
    """Both wheels lock; the stop ends, and the vehicle rocks back on its tires."""
    events = [what for _, what in locked.reference.changes]
    assert events[:2] == ["front slides", "front stands"]
    result = locked.simulated()
    assert not above(apart(result, locked.reference), CLOSE)
    assert end_of(result) == pytest.approx(
        (locked.reference.time, locked.reference.distance), abs=1e-5
    )


def test_controlled_stop(held: Scene) -> None:
    """The front tire slides once and grips again; until the stop."""
    events = [what for _, what in held.reference.changes]
    assert events[:2] == ["front slides", "front grips"]
    result = held.simulated()
    assert not above(apart(result, held.reference, held.reference.time), CLOSE)
    assert end_of(result) == pytest.approx((held.reference.time, held.reference.distance), abs=2e-5)


def test_slow_stop(slow: Scene) -> None:
    """The rebound, and the ringing after it: wheels lock and break loose on the damped tires."""
    assert sum(what == "standstill" for _, what in slow.reference.changes) >= 5
    result = slow.simulated()
    assert not above(apart(result, slow.reference), CLOSE)
    assert -result["v"].min() == pytest.approx(-slow.reference.states["v"].min(), abs=1e-5)


def test_the_reference_is_converged(slow: Scene) -> None:
    """A hundredth of the error of its steps changes it by less than a tenth of what is asked."""
    run = run_of(slow.experiment, slow.surface, slow.options, slow.overrides)
    bike, demand = vehicle_of(run, DRY), demanded(run.par.ecu.p_rate)
    fine = stop(bike, demand, 3.0, 0.6, tolerance=1e-11)
    for name in ("x", "v"):
        change = np.abs(fine.states[name] - slow.reference.states[name][: fine.t.size]).max()
        assert change < 0.1 * CLOSE[name]


def both(name: str, value: float) -> dict[str, float]:
    return {f"vehicle.{place}_tyre.{name}": value for place in ("front", "rear")}


MISTAKES = {
    "relaxation length": both("sigma", 0.11),
    "no damping": both("c_t", 0.0),
    "load transfer": {"vehicle.body.tau_N": 0.084},
    "adhesion": {"vehicle.road.grip": 1.001},
    "disc": {"front.disc.mu_pad": 0.4505},
    "rolling resistance": {"vehicle.front_wheel.C_rr": 0.0165},
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_comparison_can_fail(slow: Scene, mistake: str) -> None:
    """Each of them, and by far."""
    found = apart(slow.simulated(**MISTAKES[mistake]), slow.reference)
    assert above(found, {name: 10.0 * bound for name, bound in CLOSE.items()})
