"""What a design keeps besides its requirements, and by which figures gains are told apart."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np
import pytest
from scipy import signal

from bywire.analysis.crossings import margin
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import LOOPS
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import margins
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import UnitError
from bywire.synthesis.bench_figures import BenchFigures, Small
from bywire.synthesis.designer import DISK, bench_floors, design, linear_floors
from bywire.synthesis.linear_case import (
    NOMINAL,
    LinearCase,
    cases_of,
    read,
    room,
    share_left,
    slack,
)
from bywire.synthesis.verification import Candidate, judged
from few_starts import few_starts


def case_of(name: str) -> tuple[Any, Any, LinearCase]:
    loop = LOOPS.find(name)
    par = parameters(main_set(loop.assembly))
    return loop, par, cases_of(loop, par, loop.at.default, {})[0]


def texts(found: Any) -> list[str]:
    return list(map(str, found))


def test_floors_give_way_to_what_the_user_asks() -> None:
    wide = read(["bandwidth >= 10 Hz", "phase margin >= 60 deg"])
    assert texts(linear_floors(wide, 0.1)) == [
        f"disk_margin >= {DISK}",
        "steady_state_error <= 5 %",
    ]
    assert texts(linear_floors(wide, 8.0))[1] == "steady_state_error <= 12 %"
    own = read(["disk margin >= 0.2", "steady-state error <= 20 %"])
    assert linear_floors(own, 0.1) == ()
    # A disk margin guarantees a phase margin of 2 atan(alpha/2).
    (narrow, _) = linear_floors(read(["phase margin >= 20 deg"]), 0.1)
    assert 2.0 * math.degrees(math.atan(0.5 * narrow.bound)) == pytest.approx(20.0, abs=0.05)
    (narrow, _) = linear_floors(read(["gain margin >= 1.2"]), 0.1)
    assert (2.0 + narrow.bound) / (2.0 - narrow.bound) == pytest.approx(1.2, abs=1e-3)
    assert len(linear_floors(wide, 99.0)) == 1  # an output that does not track its input


def test_floors_on_the_bench_are_the_linear_designs_figures() -> None:
    wide = read(["bandwidth >= 10 Hz"])
    floors = linear_floors(wide, 0.1)

    def kept(error: float, time: float, more: Any = wide) -> dict[str, float]:
        step = {"steady_state_error": error, "settling_time": time, "overshoot": 3.0}
        found = bench_floors(more, floors, [BenchFigures((), step), BenchFigures((), {})])
        return {one.figure: one.bound for one in found}

    assert kept(0.05, 0.6) == pytest.approx(
        {"disk_margin": DISK, "steady_state_error": 5.0, "settling_time": 0.9}
    )
    assert kept(12.0, math.nan) == pytest.approx({"disk_margin": DISK, "steady_state_error": 18.0})
    asked = (*wide, *read(["settling time <= 2 s"]))
    assert "settling_time" not in kept(0.05, 0.6, asked)


SAMPLED = control.c2d(control.tf([1.0], [1e-3, 0.11, 1.0]), 5e-3)
PLANT = SAMPLED.num[0][0], SAMPLED.den[0][0]


def motor(gains: Any) -> tuple[LinearModel, LinearModel]:
    """Return loop gain and closed loop of a PI with a set-point weight, sampled with 5 ms.

    The plant is 1/((0.1 s + 1)(0.01 s + 1)), and control a sample late.
    """
    k_p, k_i, b = gains["k_p"], gains["k_i"], gains["b"]
    T = 5e-3
    num, den = PLANT
    over, ahead = (np.polymul(num, [p, k_i * T - p]) for p in (k_p, b * k_p))
    under = np.polymul(np.append(den, 0.0), [1.0, -1.0])
    return plain(over, under), plain(ahead, np.polyadd(under, over))


def plain(num: Any, den: Any) -> LinearModel:
    A, B, C, D = signal.tf2ss(num, den)
    n = len(A)
    return LinearModel(
        "motor",
        A,
        B,
        C,
        D,
        tuple(f"x_{k}" for k in range(n)),
        ("u",),
        ("y",),
        ("1",) * n,
        ("1",),
        ("1",),
        np.zeros(n),
        5e-3,
    )


MOTOR = LinearCase(NOMINAL, motor)
SPANS = {"k_p": (1e-2, 30.0), "k_i": (1e-3, 300.0), "b": (0.0, 1.0)}
START = {"k_p": 1.0, "k_i": 10.0, "b": 1.0}


def test_a_bandwidth_alone_does_not_end_at_the_border_of_stability() -> None:
    found = design(SPANS, read(["bandwidth >= 3 Hz"]), [MOTOR], START)
    assert found.status == "met"
    assert texts(found.kept) == ["disk_margin >= 0.5", "steady_state_error <= 5 %"]
    own = MOTOR.figures(found.gains)
    assert own.bandwidth >= 3.0
    assert own.disk_margin > DISK
    assert own.steady_state_error < 5.0
    (first, *_) = found.binding
    assert found.slack == pytest.approx(share_left(first.requirement, first.value))


def test_at_best_is_never_less_than_what_other_gains_have() -> None:
    spans = {"k_p": (1e-2, 30.0), "k_i": (1e-2, 300.0)}
    held = LinearCase(NOMINAL, lambda gains: motor({**gains, "b": 1.0}))
    start = {"k_p": 1.0, "k_i": 10.0}
    with few_starts():
        found = design(spans, read(["bandwidth >= 60 Hz", "phase margin >= 70 deg"]), [held], start)
    assert found.status == "infeasible"
    best = {(one.wanted.figure, one.kept.figure): one.best for one in found.conflicts}
    every = [
        held.figures({"k_p": k_p, "k_i": k_i})
        for k_p in np.geomspace(0.3, 20.0, 8)
        for k_i in np.geomspace(0.1, 100.0, 6)
    ]
    seen = [one.bandwidth for one in every if one.is_stable and one.phase_margin >= 70.0]
    assert best["bandwidth", "phase_margin"] >= 0.99 * max(seen)


def test_a_bandwidth_counts_from_rest() -> None:
    """A slow integrator leaves |T| below -3 dB of its value at rest for all but the slowest."""
    loop, par, case = case_of("pressure")
    gains = {"ecu.pressure.k_p": 1e-8, "ecu.pressure.k_i": 2e-8, "ecu.pressure.k_d": 0.0}
    found = case.figures(gains, 2000)
    low = np.geomspace(1e-5, 1.0, 3000)
    size = np.abs(found.closed.response(low)[:, 0, 0])
    expected = low[np.flatnonzero(size < math.sqrt(0.5) * size[0])[0]]
    assert found.bandwidth == pytest.approx(expected, rel=5e-3)
    assert expected < 0.01
    own = margins(loop, par.replace(gains), loop.at.default)
    assert own.bandwidth == pytest.approx(expected, rel=5e-3)
    (wanted,) = read(["bandwidth >= 1 Hz"])
    assert slack(found, wanted) < 0.0
    assert room(found, wanted) == pytest.approx(found.bandwidth - 1.0)


def test_the_phase_margin_is_the_smallest_of_all_crossovers() -> None:
    s = control.tf("s")
    plant = 3.0 / (s * (1.0 + s / 10.0)) * 2500.0 / (s**2 + 0.5 * s + 2500.0)

    def response(f: Any) -> Any:
        return plant(2j * np.pi * np.asarray(f))

    _, phases, _, _, at, _ = control.stability_margins(plant, returnall=True)
    assert len(phases) > 1
    found = margin(response, (1e-2, 1e2))
    nearest = int(np.argmin(np.abs((np.asarray(phases) + 180.0) % 360.0 - 180.0)))
    wrapped = (found.phase + 180.0) % 360.0 - 180.0
    assert wrapped == pytest.approx((phases[nearest] + 180.0) % 360.0 - 180.0, abs=0.01)
    assert found.at == pytest.approx(at[nearest] / 2.0 / np.pi, rel=1e-4)
    assert found.crossover == pytest.approx(max(at) / 2.0 / np.pi, rel=1e-4)


def small(least: float, bandwidth: float) -> Small:
    return Small(1.0, bandwidth, least, math.nan, math.nan, 1.0, True)


def test_the_room_of_a_bandwidth_is_that_of_the_frequency() -> None:
    requirements = read(["bandwidth >= 30 Hz"])
    linear = {str(one): 1.0 for one in requirements}

    def one(least: float, bandwidth: float) -> Candidate:
        found = BenchFigures((small(least, bandwidth), small(1.0, 60.0)), {})
        return judged(requirements, {}, {"nominal": found}, linear)

    short, flat, fast, faster = one(0.4, 27.0), one(0.6, 21.4), one(0.9, 36.0), one(0.8, 45.0)
    assert flat.slack > short.slack  # what a search climbs
    assert short.room("bandwidth >= 30 Hz") == pytest.approx(-0.1)
    assert faster.room("bandwidth >= 30 Hz") == pytest.approx(0.5)
    # Where nothing meets it, the nearer figure is preferred; where several do, the larger one.
    assert max([flat, short], key=lambda c: c.standing(0.02)) is short
    assert max([fast, faster, short], key=lambda c: c.standing(0.02)) is faster
    assert min([flat, short, fast], key=lambda c: c.standing(0.02)) is flat


def test_a_phase_margin_without_unit_is_told_how_to_write_it() -> None:
    with pytest.raises(UnitError, match="60 deg"):
        read(["phase margin >= 60"])


def test_noise_gain_is_that_of_simulated_noise() -> None:
    """A first-order loop, L = a / (z - 1): the closed form, and a simulation of white noise."""
    a = 0.3
    gain, closed = (
        LinearModel(
            "loop",
            np.array([[pole]]),
            np.array([[a]]),
            np.array([[1.0]]),
            np.array([[0.0]]),
            ("y",),
            ("u",),
            ("y",),
            ("1",),
            ("1",),
            ("1",),
            np.zeros(1),
            1e-3,
        )
        for pole in (1.0, 1.0 - a)
    )
    found = LoopFigures(gain, closed).noise_gain
    assert found == pytest.approx(math.sqrt(a / (2.0 - a)), rel=1e-4)
    noise = np.random.default_rng(1).normal(0.0, 1.0, 200_000)
    y = signal.lfilter([0.0, a], [1.0, a - 1.0], noise)
    assert found == pytest.approx(float(y.std()), rel=0.01)
