"""What Nyquist and Nichols charts show: disks that loop gains touch, crossings, the worst curve."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import UNSTABLE, Family, LoopCurve, disk, figures_at, loop_curve
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError


def curve_of(name: str, changes: dict[str, float] | None = None) -> LoopCurve:
    loop = LOOPS.find(name)
    par = parameters(main_set(loop.assembly)).replace(changes or {})
    return loop_curve(loop, figures_at(loop, par, loop.at.default), 4000)


@pytest.mark.parametrize("name", ["current", "moment", "position", "pressure"])
def test_the_loop_gain_touches_its_disk_and_stays_outside(name: str) -> None:
    curve = curve_of(name)
    free = disk(curve.margins.disk)
    nearest = np.abs(curve.L - free.middle).min() / free.radius
    assert nearest == pytest.approx(1.0, abs=1e-3)
    larger = disk(1.05 * curve.margins.disk)
    assert np.abs(curve.L - larger.middle).min() < 0.99 * larger.radius


def test_a_disk_ends_where_gain_alone_may_go() -> None:
    """The gain may vary within (2 - a)/(2 + a) and its inverse; -1 over them ends the diameter."""
    free = disk(1.0)
    assert free.middle - free.radius == pytest.approx(-3.0)
    assert free.middle + free.radius == pytest.approx(-1.0 / 3.0)
    assert math.isinf(disk(2.0).radius)
    with pytest.raises(ParameterError, match=r"disk margin = 2\.1"):
        disk(2.1)


@pytest.mark.parametrize("name", ["moment", "pressure"])
def test_the_gain_margin_is_read_at_the_phase_crossover(name: str) -> None:
    curve, loop = curve_of(name), LOOPS.find(name)
    par = parameters(main_set(loop.assembly))
    (at,) = loop.gain(par, loop.at.default).response(np.array([curve.margins.gain_at]))[:, 0, 0]
    assert complex(at) == pytest.approx(-1.0 / curve.margins.gain, rel=1e-3)


def test_phase_follows_the_curve_and_gives_the_phase_margin() -> None:
    curve = curve_of("pressure")
    phase = float(np.interp(curve.margins.crossover, curve.frequency, curve.phase))
    assert 180.0 + phase == pytest.approx(curve.margins.phase, abs=0.1)
    np.testing.assert_allclose(np.exp(1j * np.radians(curve.phase)), curve.L / np.abs(curve.L))


def test_unstable_is_worse_than_any_margin() -> None:
    good, worse = curve_of("moment"), curve_of("moment", {"wedge.mu_B": 0.6})
    assert worse.margins.disk < good.margins.disk
    assert Family((good, worse, good), "wedge.mu_B", "1", (0.35, 0.6, 0.35)).worst == 1
    lost = replace(good, margins=UNSTABLE)
    assert Family((good, worse, lost), "wedge.mu_B", "1", (0.35, 0.6, 0.9)).worst == 2


def test_the_operating_point_varies_as_a_parameter_does() -> None:
    loop = LOOPS.find("pressure")
    par = parameters(main_set(loop.assembly))
    assert loop.varied(par, 20e5, "pressure", [5e5, 30e5]) == [(par, 5e5), (par, 30e5)]
    ((own, value),) = loop.varied(par, 20e5, "ecu.pressure.k_p", [1e-5])
    assert (own.leaves()["ecu.pressure.k_p"], value) == (1e-5, 20e5)
