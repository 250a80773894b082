"""Relations of the wedge brake that are linear in drifting parameters (friction, clearance)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.errors import not_valid
from bywire.core.typing import Array
from bywire.data.recursive_filter import filtered
from bywire.identification.tracking import Relation, Rows

if TYPE_CHECKING:
    import xarray as xr

_PRESSED = 0.1  # fraction of the maximum force below which the relation is imprecise
_STEADY = 0.02  # maximum change per sensor time constant, relative to the maximum force
_SMOOTHED = 10.0  # smoothing window against noise, in sensor time constants


def _steady(data: xr.Dataset, force: str, par: WedgeParameters) -> NDArray[np.bool_]:
    """Return the rows in which a force presses and changes slowly enough for the moment sensor."""
    t, F = data["time"].values, np.abs(data[force].values)
    top = float(np.nanmax(F))
    lag = 1.0 / (2.0 * np.pi * par.moment_sensor.f_M)
    width = max(round(_SMOOTHED * lag / float(t[1] - t[0])), 1)
    smooth = np.convolve(
        np.pad(F, (width // 2, width - 1 - width // 2), mode="edge"),
        np.ones(width) / width,
        mode="valid",
    )
    calm = np.abs(np.gradient(smooth, t)) * lag < _STEADY * top
    return np.asarray((_PRESSED * top < F) & calm & np.isfinite(F))


def _lagged(F: Array, data: xr.Dataset, par: WedgeParameters) -> Array:
    t = data["time"].values
    keep = float(np.exp(-2.0 * np.pi * par.moment_sensor.f_M * (t[1] - t[0])))
    there = np.isfinite(F)
    filled = np.interp(t, t[there], F[there]) if there.any() else F
    # This is the lag's response to a force that is linear from sample to sample.
    slope = (1.0 - keep) / -np.log(keep)
    numerator = [1.0 - slope, slope - keep]
    late = filtered(numerator, [1.0, -keep], filled, settled=True)
    return np.where(there, late, np.nan)


def _rows(y: Array, phi: Array, used: NDArray[np.bool_]) -> Rows:
    return Rows(np.where(used[:, None], phi, np.nan), np.where(used, y, np.nan))


def _from_normal_force(data: xr.Dataset, par: WedgeParameters) -> Rows:
    """Return M = mu_B 2 r_B F_N for both pads (2003, section "Wedge and calliper").

    The force passes through the moment sensor's lag, so both signals have the same delay.
    """
    used = _steady(data, "F_N", par)
    phi = 2.0 * par.caliper.r_B * _lagged(np.abs(data["F_N"].values), data, par)
    return _rows(np.abs(data["y_M"].values), phi[:, None], used)


def _from_actuation_force(data: xr.Dataset, par: WedgeParameters) -> Rows:
    """Return M tan(alpha) = mu_B (M + 2 r_B F_M), for a wedge at rest with F_N eliminated."""
    used = _steady(data, "y_M", par)
    M, sense = np.abs(data["y_M"].values), np.sign(data["y_M"].values)
    phi = M + 2.0 * par.caliper.r_B * sense * data["F_M"].values
    return _rows(M * wedge.slope(par.wedge), phi[:, None], used)


def _from_travel(data: xr.Dataset, par: WedgeParameters) -> Rows:
    """Return |x| tan(alpha) = c + F_N / K_cal, for the caliper as a spring in contact."""
    if par.caliper.law != "linear":
        raise not_valid(
            "caliper.law", repr(par.caliper.law), "'linear'", "to track caliper.clearance"
        )
    used = _steady(data, "F_N", par)
    y = np.abs(data["x"].values) * wedge.slope(par.wedge)
    return _rows(y, np.column_stack((np.ones(y.size), data["F_N"].values)), used)


RELATIONS: tuple[Relation, ...] = (
    Relation(
        "pad friction from the normal force",
        "wedge-brake",
        ("wedge.mu_B",),
        ("1",),
        {"y_M": "N*m", "F_N": "N"},
        _from_normal_force,
        lambda par: np.array([par.wedge.mu_B]),
        "braking moment from the normal force",
    ),
    Relation(
        "pad friction from the actuation force",
        "wedge-brake",
        ("wedge.mu_B",),
        ("1",),
        {"y_M": "N*m", "F_M": "N"},
        _from_actuation_force,
        lambda par: np.array([par.wedge.mu_B]),
        "wedge at rest, neglecting internal friction, which biases the estimate by up to its ratio "
        "to the normal force, in opposite directions while applying and releasing",
    ),
    Relation(
        "clearance from the travel",
        "wedge-brake",
        ("caliper.clearance", "1/caliper.K_cal"),
        ("m", "m/N"),
        {"x": "m", "F_N": "N"},
        _from_travel,
        lambda par: np.array([par.caliper.clearance, 1.0 / par.caliper.K_cal]),
        "caliper as a spring; disc runout is treated as noise",
    ),
)
"""relations in order of preference. bywire uses the first one whose signals are measured"""
