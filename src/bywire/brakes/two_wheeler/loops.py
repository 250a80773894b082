"""Slip loop of a wheel, around the pressure loop of the brake."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.two_wheeler.rigs.wheel_on_drum import (
    Memory,
    Stimulus,
    WheelOnDrum,
    WheelOnDrumParameters,
)
from bywire.control import slip_pi
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.plant import adhesion, brake_disc, pressure_loop, road_wheel, tyre

SPEED = Quantity("speed", "m/s", 20.0)


def point(par: ParameterSet, value: float) -> Point:
    """Return the wheel at its slip set point while the vehicle keeps a speed [m/s].

    Raises
    ------
    ParameterError
        If the speed is not positive, or if the slip is beyond the peak, where the wheel is unstable
        without control.
    """
    SPEED.require_positive(value)
    at = cast(WheelOnDrumParameters, par.replace({"drum.v": value}))
    slip = slip_pi.set_point(value, at.slip)
    surface = adhesion.surface_of(at.drum.surface)
    peak = adhesion.peak_slip(surface, at.tyre)
    if not slip < peak:
        valid, advice = f"< {peak:.3g}", "the slip at maximum adhesion"
        raise not_valid("slip.slip_set", f"{slip:g}", valid, advice)
    v_wheel = value * (1.0 - slip)
    force = at.drum.N * adhesion.adhesion(slip, surface, at.tyre)
    held = at.wheel.r * force - road_wheel.rolling_resistance(at.drum.N, at.wheel)
    p = held / brake_disc.torque_per_pressure(at.brake.disc)
    state = WheelOnDrum.state(
        wheel=road_wheel.State(v_wheel / at.wheel.r),
        tyre=tyre.State(at.tyre.sigma * slip),
        circuit=pressure_loop.State(p, 0.0),
    )
    memory = Memory(p_ref=p, slip_hat=slip, slip_ref=slip, integral=p, acts=1.0)
    return Point(WheelOnDrum(), at, state, memory, Stimulus(slip_set=slip, p_set=2.0 * p))


LOOP = Loop(
    name="slip",
    assembly="wheel-on-drum",
    summary="slip control of a wheel at 1 kHz, around the pressure loop of its brake",
    at=SPEED,
    inputs=("slip_set",),
    output="slip",
    cut="p_ref",
    point=point,
    causes={"curve of the adhesion": {"drum.surface.c3": 1e-6}},
    band=(0.2, 50.0),
    amplitudes=(1e-3, 5e-3),
    tunables={"slip.omega_c": (1.0, 200.0), "slip.T_i": (0.01, 2.0)},
)
