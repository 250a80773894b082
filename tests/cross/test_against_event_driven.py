"""The engine at 20 us against an independent, event-driven integrator of the same brake."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.simulation.run import Run, simulate
from cross.motorcycle_reference import run_reference

BAR = 1e5
REFERENCE_STEP = 4e-4
RAMP = {"kind": "ramp", "start": 0.0, "end": 5.0, "slope": 0.2, "t_start": 0.0, "t_hold": 0.0}


def braking(law: str, dither: str) -> Run:
    """Return hard braking from 6 to 37 bar; the reference knows no quantizer."""
    bench = Bench(
        "hard-braking",
        "dardanelli2010",
        overrides={"adc.law": "ideal", "gear.law": law, "ecu.dither.waveform": dither},
        options={"settle": 0.2, "duration": 0.6},
    )
    return as_run(bench.cases()[0], bench.step)


def ramp(law: str, duration: float) -> Run:
    """Return the ramp of eq. (17), from an ideal current source that holds for 5 ms."""
    bench = Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides={"gear.law": law, "drive.T_source": 5e-3},
        options={"source": "current", "duration": duration, "record": 5e-3},
        stimulus=RAMP | {"after": "return"},
    )
    return as_run(bench.cases()[0], bench.step)


def compare(run: Run, reference: dict[str, Any], limit: float) -> None:
    """Pressures at all ticks within a limit [bar]; stuck at the same ticks, but for a few."""
    result = simulate(run)
    assert result.status == "done"
    np.testing.assert_allclose(result.time, reference["t"], atol=1e-9)
    difference = np.abs(result["p_mc"] - reference["p_mc"]).max() / BAR
    assert difference < limit
    # A slip may begin or end within the substep before the tick.
    apart = np.count_nonzero((result["stuck"] > 0.0) != reference["stuck"])
    assert apart <= 1 + reference["t"].size // 1000


class Short(NamedTuple):
    """Hard braking with dither for a moment, and what the reference says of it."""

    run: Run
    reference: dict[str, Any]


@pytest.fixture(scope="module")
def short() -> Short:
    run = replace(braking("directional", "sine"), duration=0.4)
    return Short(run, run_reference(run, REFERENCE_STEP))


LAWS = ("paper", "directional")
laws = pytest.mark.parametrize("law", LAWS)


def test_hard_braking_with_dither(short: Short) -> None:
    assert short.reference["mode_changes"] > 50
    compare(*short, 0.01)


@pytest.mark.trust
@laws
def test_hard_braking_with_dither_to_its_end(law: str) -> None:
    run = braking(law, "sine")
    reference = run_reference(run, REFERENCE_STEP)
    assert reference["mode_changes"] > 100
    compare(run, reference, 0.01)


@laws
def test_hard_braking_without_dither(law: str) -> None:
    run = braking(law, "off")
    compare(run, run_reference(run, REFERENCE_STEP), 0.001)


@pytest.mark.parametrize(
    ("law", "duration"),
    [("directional", 18.0), *(pytest.param(law, 36.0, marks=pytest.mark.trust) for law in LAWS)],
)
def test_ramp(law: str, duration: float) -> None:
    """The staircase of jumps, and the way back."""
    run = ramp(law, duration)
    reference = run_reference(run, REFERENCE_STEP)
    assert reference["mode_changes"] >= 12
    assert 0.8 < reference["stuck"].mean() < 0.99
    compare(run, reference, 0.005)


def test_the_reference_is_converged(short: Short) -> None:
    """Half its step changes it by less than a hundredth of what is asked of the engine."""
    coarse, fine = short.reference, run_reference(short.run, REFERENCE_STEP / 2.0)
    assert np.abs(coarse["p_mc"] - fine["p_mc"]).max() < 1e-4 * BAR
    np.testing.assert_array_equal(coarse["stuck"], fine["stuck"])


@pytest.mark.parametrize(
    ("name", "factor"), [("seal.k_brk_p", 1.01), ("gear.eta_g", 1.01), ("fluid.beta", 0.8)]
)
def test_the_comparison_can_fail(short: Short, name: str, factor: float) -> None:
    """One per cent of friction or efficiency shows, and so does a softer fluid."""
    par = short.run.par
    other = replace(short.run, par=par.replace({name: factor * par.leaves()[name]}))
    with pytest.raises(AssertionError):
        compare(other, short.reference, 0.01)
