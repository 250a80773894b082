"""The two-stage stiffness test has almost no model error with ideal sensors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.brakes.wedge.methods.force_calibration import Squeeze, cogging_waves
from bywire.brakes.wedge.methods.stiffness import METHOD, Contacts, clear_of, truth
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.identification.method import Effort

Array = NDArray[np.float64]

ORDER = 180.0
IDEAL = {"heart.K_S": 1e-5, "heart.K_W": 3e-5, "free_play": 3e-5, "force_per_current": 5e-6}
"""error of the estimates, a tenth or less of what the sensors' noise makes"""


def test_ideal_sensors_leave_no_error_of_the_model() -> None:
    par = parameters("roberts2003").replace({"encoder.law": "ideal"})
    assert isinstance(par, WedgeParameters)
    options = METHOD.defaults.replace({"sigma_i": 0.0, "sigma_F": 0.0})
    found = METHOD.identify(METHOD.synthetic(par, options, 1), par, options, Effort(starts=1))
    estimate = found.estimates["stiffness and free play"]
    assert set(estimate.names) == {*METHOD.unknowns, *METHOD.further}
    known = par.leaves() | truth(par, options)
    for label, error in IDEAL.items():
        assert estimate[label] == pytest.approx(known[label], rel=error), label


def left_over(q_1: Array, q_2: Array, current: Array) -> float:
    """Return what the waves leave of a current, beside an offset."""
    columns = np.column_stack((np.ones_like(q_1), cogging_waves(q_1, q_2, ORDER)))
    rest = current - columns @ np.linalg.lstsq(columns, current, rcond=None)[0]
    return float(np.abs(rest).max())


def test_waves_hold_the_cogging_of_both_motors() -> None:
    """Each with a phase and an amplitude of its own, while both are moved the same way too."""
    angle = np.linspace(0.0, 0.3, 500)
    q_1, q_2 = angle + 6e-4 * np.cos(ORDER * angle), -angle + 9e-4 * np.sin(ORDER * angle)
    current = 0.05 * np.cos(ORDER * q_1 + 0.4) + 0.07 * np.cos(ORDER * q_2 + 1.1)
    assert left_over(q_1, q_2, current) < 1e-12
    assert left_over(angle, -angle, current) > 1e-3


@pytest.mark.parametrize("first_moves", [True, False])
def test_a_motor_that_stands_leaves_the_waves_of_the_other(first_moves: bool) -> None:
    angle, still = np.linspace(0.0, 0.3, 500), np.full(500, 0.1)
    q_1, q_2 = (angle, still) if first_moves else (still, angle)
    assert left_over(q_1, q_2, 0.05 * np.cos(ORDER * angle + 0.4)) < 1e-12
    assert not cogging_waves(q_1, q_2, ORDER)[:, 2:].any()


def test_windows_at_and_after_a_contact_are_left_out() -> None:
    """Moving up and down past a contact at 3, with a reach of two windows."""
    d = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    reach = np.concatenate(
        (np.column_stack((d - 2.4, d + 0.4)), np.column_stack((d + 2.4, d - 0.4)))
    )
    none = np.zeros(14)
    heart = Squeeze(none, none, np.tile(d, 2), none, np.zeros((14, 4)), reach, none, 0.3)
    kept = clear_of(Contacts(closed=3.0, apart=-10.0), heart)
    assert heart.only(kept).d.tolist() == [0.0, 1.0, 2.0, 6.0, 0.0, 4.0, 5.0, 6.0]
