"""Linear models with stop operators: stiffness of those that follow, none of those that slip."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from bywire.analysis.linear.corners import CornerError, taking
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import equilibrium, linearize
from bywire.plant import pad_hysteresis, shaft
from bywire.simulation.run import Run, simulate
from raising import raises
from systems.pad_press import PADS, PAR, Memory, PadPress

WIDTHS = (12.5e-6, 50e-6, 150e-6, 400e-6)


def at(*z: float, angle: float = 2.0) -> Any:
    return PadPress.state(shaft=shaft.State(angle, 0.0), pads=pad_hysteresis.State(*z))


def linear(state: Any, par: Any = PAR, side: str = "") -> LinearModel:
    with taking(side):
        model = PadPress()
        return linearize(model, par, state, Memory(0.0), inputs=("T",), outputs=("theta",))


def test_within_its_width_a_spring_counts() -> None:
    model = linear(at(1e-6, -2e-6, 0.0, 0.0))
    rates = model.A[2:, 1]
    np.testing.assert_allclose(rates, PAR.lead)
    assert model.corners == ()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_at_its_width_it_needs_a_side(sign: float) -> None:
    state = at(sign * WIDTHS[0], 1e-6, 0.0, 0.0)
    with raises(CornerError, name="z_1"):
        linear(state)
    slipping, following = (linear(state, side=side) for side in ("above", "below"))
    assert "z_1 slips" in " ".join(slipping.corners)
    assert "z_1 sticks" in " ".join(following.corners)
    assert not slipping.A[2].any()
    assert following.A[2, 1] == pytest.approx(PAR.lead)
    np.testing.assert_array_equal(slipping.A[3:], following.A[3:])


def test_a_spring_without_slip_force_has_no_corner() -> None:
    model = linear(at(0.0, 0.0, 0.0, 0.0), PAR.replace({"pads.W_2": 0.0}))
    assert not model.A[3].any()
    assert model.corners == ()


def test_a_slipping_spring_follows_its_width() -> None:
    """Its width is in proportion to the load, which is in proportion to the angle."""
    par = PAR.replace({"pads.law": "load"})
    by_angle = 50.0 / PADS.F_ref * PAR.k_c * PAR.lead / PADS.k_1
    for sign in (1.0, -1.0):
        state = at(sign * 2.0 * by_angle, 0.0, 0.0, 0.0)
        model = linear(state, par, "above")
        assert "z_1 slips" in " ".join(model.corners)
        assert model.A[2, 1] == pytest.approx(sign * by_angle, rel=1e-9)
        assert linear(state, par, "below").A[2, 1] == pytest.approx(PAR.lead)


@pytest.mark.parametrize("law", ["constant", "load"])
@pytest.mark.parametrize(("side", "sign"), [("above", 1.0), ("below", -1.0)])
def test_small_motions_are_those_of_the_stated_side(side: str, sign: float, law: str) -> None:
    """The first spring at its width: a small torque outward, and inward, from rest."""
    par = PAR.replace({"T_fr": 0.0, "shaft.d": 0.05, "pads.law": law, "pads.F_ref": 1e4})
    load = PAR.k_c * PAR.lead * 2.0
    W = 50.0 * (load / 1e4 if law == "load" else 1.0)
    start = at(W / PADS.k_1, 1e-6, 0.0, 0.0)
    force = load + W + PADS.k_2 * 1e-6
    rest = PAR.lead * force
    step = sign * 1e-4

    class Open(PadPress):
        """The press, driven by a torque."""

        def tasks(self, par: Any) -> Any:
            """Return the torque demanded."""
            (task,) = super().tasks(par)
            return (replace(task, tick=lambda x, m, u, p: Memory(u.angle_set)),)

    result = simulate(
        Run(Open(), par, start, Memory(rest), lambda t: rest + step + 0.0 * t[:, None], 0.01, 2e-5)
    )
    model = linear(start, par, side)
    wide = np.zeros((7, 7))  # one more row for the torque, which is constant
    wide[:6, :6], wide[:6, 6] = model.A, model.B[:, 0]
    expected = np.array([expm(wide * t)[0, 6] for t in result.time]) * step
    found = result["theta"] - 2.0
    assert np.abs(found - expected).max() < 2e-4 * np.abs(expected).max()


def test_an_equilibrium_keeps_its_hysteresis() -> None:
    start = at(5e-6, 5e-6, 0.0, 0.0, angle=1.9)
    state, memory = equilibrium(
        PadPress(), PAR, start, Memory(0.0), given=("theta",), inputs=("T",)
    )
    assert state[2:] == start[2:]
    force = PAR.k_c * PAR.lead * 1.9 + (PADS.k_1 + PADS.k_2) * 5e-6
    assert pytest.approx(PAR.lead * force, rel=1e-9) == memory.T
