"""Animation of the two-wheeler."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bywire.brakes.two_wheeler.case import vehicle_of
from bywire.report import style
from bywire.report.animation.scene import Scene, SceneKind
from bywire.vehicle.stop_scene import SCALE, Wheel, stop_scene
from bywire.vehicle.two_wheeler import VehicleParameters

if TYPE_CHECKING:
    import xarray as xr

_DIALS = (
    ("v", "vehicle speed", "km/h", 3.6, 120.0, style.BLUE),
    ("v_f", "front tread", "km/h", 3.6, 120.0, style.ORANGE),
    ("v_r", "rear tread", "km/h", 3.6, 120.0, style.GREEN),
    ("slip_f", "front slip", "", 1.0, 1.0, style.ORANGE),
    ("slip_r", "rear slip", "", 1.0, 1.0, style.GREEN),
    ("p_f", "front pressure", "bar", 1e-5, 40.0, style.ORANGE),
    ("p_r", "rear pressure", "bar", 1e-5, 40.0, style.GREEN),
    ("a", "deceleration", "m/s²", 1.0, 12.0, style.BLUE),
)


def _stop(run: xr.Dataset) -> Scene:
    par = vehicle_of(run)
    wheels = [
        Wheel(behind, wheel.r, f"omega_{s}", f"sliding_{s}", f"N_{s}", f"F_{s}")
        for behind, wheel, s in ((0.0, par.front_wheel, "f"), (par.body.L, par.rear_wheel, "r"))
    ]
    weight = par.body.m * par.body.g
    return stop_scene(
        run, par.road, wheels, _body(par), _DIALS, place="x", weight=weight, pitch="phi"
    )


def _body(par: VehicleParameters) -> str:
    """Return frame, fork and rider relative to the front contact, with the center of gravity."""
    L, l_f, h = (SCALE * each for each in (par.body.L, par.body.l_f, par.body.h))
    front, rear = SCALE * par.front_wheel.r, SCALE * par.rear_wheel.r
    bars, seat = (-0.25 * L, -0.68 * L), (-0.72 * L, -0.55 * L)
    frame = f"M0 {-front:g}L{bars[0]:g} {bars[1]:g}L{seat[0]:g} {seat[1]:g}L{-L:g} {-rear:g}"
    engine = f"L{-0.45 * L:g} {-0.25 * L:g}L{bars[0]:g} {bars[1]:g}"
    rider = (
        f"M{bars[0]:g} {bars[1]:g}L{-0.46 * L:g} {-0.9 * L:g}L{seat[0]:g} {seat[1]:g}"
        f"L{-0.5 * L:g} {-0.42 * L:g}L{-0.6 * L:g} {-0.18 * L:g}"
    )
    line = 'fill="none" stroke-linejoin="round" stroke-linecap="round"'
    return (
        f'<path d="{rider}" {line} stroke="{style.GRAY}" stroke-width="12"/>'
        f'<circle cx="{-0.4 * L:g}" cy="{-1.02 * L:g}" r="13" fill="{style.GRAY}"/>'
        f'<path d="{frame}{engine}" {line} stroke="{style.BLUE}" stroke-width="8"/>'
        f'<path d="M{-l_f - 6:g} {-h:g}h12m-6 -6v12" {line} stroke="{style.BLACK}" '
        'stroke-width="2"/>'
    )


STOP = SceneKind("two-wheeler-by-wire", "x", _stop)
WHOLE_REAR_STOP = SceneKind("two-wheeler-whole-rear", "x", _stop)
