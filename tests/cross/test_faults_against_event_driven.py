"""Faults during hard braking, put into an independent, event-driven integrator by hand."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.brakes.motorcycle import ecu
from bywire.plant import current_sensor, pressure_sensor
from bywire.simulation.run import Run, simulate
from cross.motorcycle_reference import plant_of
from reference.event_driven import STATES
from reference.event_driven import simulate as simulate_reference

STEP = 4e-4
SETTLE = 0.2
OFFSET, GAIN, LATE = 2e5, 0.8, 3
# Windows on the recording's axis [s], one after the other; parameters stay changed.
WINDOWS = {
    "offset": (0.05, 0.09),
    "gain": (0.10, 0.13),
    "late": (0.14, 0.17),
    "dropped": (0.18, 0.21),
    "frozen": (0.22, 0.228),
}
HOT, SWOLLEN = 0.07, 0.16
FAULTS = [
    {"fault": "pressure.offset", "value": OFFSET, "onset": 0.05, "lasts": 0.04},
    {"fault": "current.gain", "value": GAIN, "onset": 0.10, "lasts": 0.03},
    {"fault": "bridge.late", "value": LATE, "onset": 0.14, "lasts": 0.03},
    {"fault": "ecu.dropped", "value": 2, "onset": 0.18, "lasts": 0.03},
    {"fault": "ecu.frozen", "onset": 0.22, "lasts": 0.008},
    {"fault": "motor.hot", "value": 1.5, "onset": HOT},
    {"fault": "seal.swollen", "value": 1.2, "onset": SWOLLEN},
]


@pytest.fixture(scope="module")
def faulty() -> Run:
    (run,) = (
        Bench(
            "hard-braking",
            "dardanelli2010",
            overrides={"adc.law": "ideal", "gear.law": "directional"},
            options={"settle": SETTLE, "duration": 0.25},
            faults=FAULTS,
        )
        .runs()
        .values()
    )
    return run


@pytest.fixture(scope="module")
def reference(faulty: Run) -> dict[str, Any]:
    """Return the same run by the reference, its faults written out."""
    par, period = faulty.par, faulty.par.ecu.T_s
    inside = faulty.model.inner  # type: ignore[attr-defined]
    count = len(inside.Stimulus._fields)
    times = period * np.arange(round(faulty.duration / period) + 1)
    rows = [ecu.Stimulus(*map(float, row[:count])) for row in faulty.stimulus(times)]
    memory = inside.Memory(*faulty.memory[: len(inside.Memory._fields)])
    given: list[float] = [memory.duty] * LATE

    def is_there(name: str, k: int) -> bool:
        first, last = (round((t + SETTLE) / period) for t in WINDOWS[name])
        return first <= k < last

    def tick(k: int, state: dict[str, float]) -> float:
        nonlocal memory
        missed = is_there("frozen", k) or (
            is_there("dropped", k) and (k - round((0.18 + SETTLE) / period)) % 2 == 1
        )
        if not missed:
            p = state["p_f"] + (OFFSET if is_there("offset", k) else 0.0)
            i = state["i_f"] * (GAIN if is_there("gain", k) else 1.0)
            readings = ecu.Readings(
                p=pressure_sensor.reading(p + par.fluid.p_atm, par.pressure_sensor),
                i=current_sensor.reading(i, par.current_sensor),
            )
            memory = ecu.tick(readings, memory, rows[k], par)
        given.append(float(memory.duty))
        return given[-1 - LATE] if is_there("late", k) else given[-1]

    seal = {f"seal.{n}": 1.2 * par.value(f"seal.{n}") for n in ("T_pr", "f_cfr_p", "f_cfr_n")}
    hot = par.replace({"motor.R_m": 1.5 * par.motor.R_m})
    edges = [0, *(round((t + SETTLE) / period) for t in (HOT, SWOLLEN)), len(times) - 1]
    x0 = dict(zip(faulty.state._fields, map(float, faulty.state), strict=True))
    start = {name: x0[name] for name in STATES[:5]} | {"p_f": x0["p_mc"], "i_f": x0["i"]}
    pieces: list[dict[str, Any]] = []
    for (k, last), now in zip(pairwise(edges), (par, hot, hot.replace(seal)), strict=True):
        made = simulate_reference(
            plant_of(now),
            lambda n, t, state, k=k: tick(k + n, state),  # type: ignore[misc]
            (last - k) * period,
            period,
            start,
            STEP,
        )
        start = {name: float(made[name][-1]) for name in STATES}
        pieces.append(made)
    return {
        name: np.concatenate([*(each[name][:-1] for each in pieces[:-1]), pieces[-1][name]])
        for name in ("p_mc", "stuck", "i")
    }


def test_every_kind_of_fault_does_what_the_reference_does(
    faulty: Run, reference: dict[str, Any]
) -> None:
    result = simulate(faulty)
    assert np.abs(result["p_mc"] - reference["p_mc"]).max() < 0.01e5
    apart = np.count_nonzero((result["stuck"] > 0.0) != reference["stuck"])
    assert apart <= 1 + len(reference["p_mc"]) // 100


@pytest.mark.parametrize("left_out", range(len(FAULTS)))
def test_a_fault_that_is_left_out_shows(left_out: int, reference: dict[str, Any]) -> None:
    others = [each for k, each in enumerate(FAULTS) if k != left_out]
    (run,) = (
        Bench(
            "hard-braking",
            "dardanelli2010",
            overrides={"adc.law": "ideal", "gear.law": "directional"},
            options={"settle": SETTLE, "duration": 0.25},
            faults=others,
        )
        .runs()
        .values()
    )
    assert np.abs(simulate(run)["p_mc"] - reference["p_mc"]).max() > 0.05e5
