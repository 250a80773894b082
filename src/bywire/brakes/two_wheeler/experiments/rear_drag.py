"""Drag of the released rear brake on a rolling vehicle, due to a sticking caliper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import Demand, on_surface, rolling_case
from bywire.brakes.two_wheeler.parameters import WholeRearParameters
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear, at_speed
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array
from bywire.plant.road import SurfaceName
from bywire.vehicle.ideal_stop import RidingSpeed

if TYPE_CHECKING:
    import xarray as xr

_LEFT = 0.1  # fraction of the torque below which the brake is treated as released
_END = 0.1  # s: averaging window at the end

FIGURES = Figures(
    drag=("N*m", f"Mean rear brake torque in the last {_END:g} s."),
    residual_pressure=("Pa", f"Mean pressure at the rear pads in the last {_END:g} s."),
    release_time=(
        "s",
        f"Time from the release until the torque stays below {_LEFT:g} times its initial value.",
    ),
)
_SIGNALS = ("T_r", "p_r")


class Options(ParameterSet):
    """The ride."""

    v_0: RidingSpeed
    """initial speed"""
    p_rear: Demand
    """rear pressure demand from the start until the release"""
    hold: Duration
    """time of the release"""
    surface: SurfaceName
    """road surface"""
    duration: Duration
    """recording time"""


def cases(par: WholeRearParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run, which starts with the rear brake applied."""

    def demand(t: Array) -> Array:
        return np.where(t < options.hold, options.p_rear, 0.0)

    changes = {**on_surface(options.surface), "rear.actuator.drive.mode": "pressure"}
    return (
        rolling_case(
            par,
            options.v_0,
            {"p_r_set": demand},
            options.duration,
            changes,
            vehicle=(
                TwoWheelerWholeRear,
                lambda v, now, heat: at_speed(v, now, heat, options.p_rear),
            ),
        ),
    )


def left(run: xr.Dataset, options: Options) -> dict[str, float | tuple[float, str]]:
    """Return drag, pressure and release time."""
    t, torque, p = (run[name].values for name in ("time", *_SIGNALS))
    end = t >= t[-1] - _END
    figures: dict[str, float | tuple[float, str]] = {
        "drag": float(torque[end].mean()),
        "residual_pressure": float(p[end].mean()),
    }
    go = int(np.searchsorted(t, options.hold))
    above = np.flatnonzero(torque > _LEFT * torque[min(go, t.size - 1)])
    if not go or go >= t.size or not torque[go] > 0.0:
        figures["release_time"] = (np.nan, "the brake was not applied, or was not released")
    elif above[-1] + 1 == t.size:
        figures["release_time"] = (np.nan, "the brake is not released within the recording")
    else:
        figures["release_time"] = float(t[above[-1] + 1] - options.hold)
    return figures


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures."""
    (run,) = recordings.values()
    return FIGURES(**left(run, options))


EXPERIMENT = Experiment(
    name="rear-drag",
    assembly="two-wheeler-whole-rear",
    summary="residual drag after the rider releases the by-wire rear brake, from {v_0}",
    options=Options,
    defaults=Options(v_0=20.0, p_rear=20e5, hold=0.5, surface="dry-asphalt", duration=2.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
