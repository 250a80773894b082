"""Animation of the wedge brake on a quarter car."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bywire.brakes.wedge.rigs.wedge_corner import WedgeCornerParameters
from bywire.report import style
from bywire.report.animation.scene import Scene, SceneKind
from bywire.vehicle.stop_scene import SCALE, Wheel, stop_scene

if TYPE_CHECKING:
    import xarray as xr

_DIALS = (
    ("v_x", "vehicle speed", "km/h", 3.6, 120.0, style.BLUE),
    ("v_tread", "tread", "km/h", 3.6, 120.0, style.ORANGE),
    ("slip", "slip", "", 1.0, 1.0, style.ORANGE),
    ("M_B", "brake moment", "N m", 1.0, 1500.0, style.VERMILLION),
    ("x", "wedge travel", "mm", 1e3, 3.0, style.PURPLE),
    ("F_N", "normal force", "kN", 1e-3, 20.0, style.PURPLE),
    ("i_1", "motor 1 current", "A", 1.0, 20.0, style.GREEN),
    ("a", "deceleration", "m/s²", 1.0, 12.0, style.BLUE),
)


def _stop(run: xr.Dataset) -> Scene:
    par = WedgeCornerParameters.model_validate_json(run.attrs["parameters"]).corner
    r = SCALE * par.r
    body = (
        f'<path d="M{-4.5 * r:g} {-2.2 * r:g}h{6 * r:g}v{-0.9 * r:g}h{-2.2 * r:g}'
        f'l{-0.8 * r:g} {-1.1 * r:g}h{-3 * r:g}z" fill="{style.PALE}" stroke="{style.GRAY}"/>'
        f'<path d="M0 {-r:g}V{-2.3 * r:g}" stroke="{style.GRAY}" stroke-width="6"/>'
    )
    wheel = Wheel(0.0, par.r, "Omega", "sliding", "N_x", "F_x")
    weight = par.body.m * par.body.g
    return stop_scene(run, par.road, [wheel], body, _DIALS, place="s", weight=weight)


STOP = SceneKind("wedge-corner", "s", _stop)
