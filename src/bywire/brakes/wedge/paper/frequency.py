"""Position frequency responses that Figs. 5 and 6 of Roberts et al. (2003) share."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.brakes.wedge.paper.runs import parameters
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.report.response_figures import Response, bode

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Complex = NDArray[np.complex128]

BANDWIDTHS = {"low": 12.0, "high": 60.0}
"""natural frequencies of the two position controllers [Hz]"""
AMPLITUDES = {"low": (0.5, 1.0, 2.0), "high": (0.25, 0.5, 1.0)}
"""amplitudes shown of each controller [rad]"""
FREQUENCIES = tuple(np.geomspace(1.0, 100.0, 40).tolist())
_BOTH = tuple(sorted({size for sizes in AMPLITUDES.values() for size in sizes}))
_WEDGE = (0.25, 0.5, 1.0)  # larger ones would reach the disc
_PRELOADS = (25.0, 50.0, 75.0, 100.0)  # N
_PATIENCE = 12  # windows granted to friction, encoder and cogging, which may never repeat


@cache
def screw() -> xr.Dataset:
    """Return the preloaded screw's responses: both controllers, all amplitudes, in one sweep."""
    return _swept("screw-position", FREQUENCIES, _BOTH, ("stuck", "sat_current"))


@cache
def wedge() -> xr.Dataset:
    """Return the assembled wedge's responses, at every third frequency."""
    return _swept("position", FREQUENCIES[::3], _WEDGE, ("stuck",))


def _swept(
    name: str, frequencies: tuple[float, ...], amplitudes: tuple[float, ...], flags: tuple[str, ...]
) -> xr.Dataset:
    loop = LOOPS.find(name)
    sweep = Sweep(
        loop.inputs,
        loop.output,
        frequencies,
        amplitudes,
        {"control.position.f_n": list(BANDWIDTHS.values())},
        flags=flags,
        most=_PATIENCE,
    )
    responses = frequency_response(loop.point(parameters(), 0.0).run(), sweep)
    return responses.assign_coords(controller=("variant", list(BANDWIDTHS)))


def of(responses: xr.Dataset, controller: str, size: float) -> xr.Dataset:
    """Return the figures of one controller and amplitude [rad], over frequency."""
    return responses.isel(variant=list(BANDWIDTHS).index(controller)).sel(amplitude=size)


def value(responses: xr.Dataset, controller: str, size: float) -> Complex:
    """Return a complex response, shape (frequencies,); NaN where the output sticks."""
    figures = of(responses, controller, size)
    return np.asarray(figures["gain"].values * np.exp(1j * np.radians(figures["phase"].values)))


def changed(controller: str) -> ParameterSet:
    """Return the parameter set with one of the controllers."""
    return parameters().replace({"control.position.f_n": BANDWIDTHS[controller]})


def linear(controller: str, frequencies: Array) -> Complex:
    """Return the response of the screw's linear model, without friction and limit."""
    loop = LOOPS.find("screw-position")
    return loop.closed(changed(controller), 0.0).response(frequencies)[:, 0, 0]


def decibels(response: Complex) -> Array:
    """Return magnitudes in dB."""
    return np.asarray(20.0 * np.log10(np.abs(response)))


def without_friction(controller: str) -> tuple[float, float]:
    """Return the largest differences of the nonlinear and the linear response, dB and degree.

    Friction, cogging and the encoder's resolution are off, and the amplitude keeps clear of the
    current limit.
    """
    loop = LOOPS.find("screw-position")
    smooth = loop.smooth(changed(controller))
    sweep = Sweep(
        loop.inputs, loop.output, FREQUENCIES[::4], loop.amplitudes[:1], flags=(), tolerance=1e-4
    )
    response = frequency_response(loop.point(smooth, 0.0).run(), sweep).squeeze()
    measured = response["gain"].values * np.exp(1j * np.radians(response["phase"].values))
    ratio = measured / linear(controller, response["frequency"].values)
    return float(np.abs(decibels(ratio)).max()), float(np.abs(np.degrees(np.angle(ratio))).max())


def apart(controller: str, *, limited: bool = True) -> float:
    """Return how far the wedge's response is from the screw's at most, % of the amplitude.

    ``limited``: whether frequencies count at which the screw reaches the current limit.
    """
    ours = screw().sel(frequency=wedge()["frequency"])
    largest = 0.0
    for size in (size for size in AMPLITUDES[controller] if size in _WEDGE):
        free = of(ours, controller, size)["share_sat_current"].values == 0
        away = np.abs(value(wedge(), controller, size) - value(ours, controller, size))
        largest = max(largest, float(away[free | limited].max()))
    return 100.0 * largest


def nearest_preload() -> tuple[float, float]:
    """Return the screw's preload [N] that comes closest to the wedge, and the distance [%].

    Low-bandwidth controller, the same amplitudes and frequencies as `apart`.
    """
    sizes = tuple(size for size in AMPLITUDES["low"] if size in _WEDGE)
    loop = LOOPS.find("screw-position")
    sweep = Sweep(
        loop.inputs,
        loop.output,
        FREQUENCIES[::3],
        sizes,
        {"rig.F_0": list(_PRELOADS)},
        flags=(),
        most=_PATIENCE,
    )
    responses = frequency_response(loop.point(changed("low"), 0.0).run(), sweep)
    values = responses["gain"].values * np.exp(1j * np.radians(responses["phase"].values))
    of_wedge = np.array([value(wedge(), "low", size) for size in sizes])
    away = np.abs(values - of_wedge).max(axis=(1, 2))
    k = int(away.argmin())
    return _PRELOADS[k], 100.0 * float(away[k])


def figure(controller: str) -> Figure:
    """Return the Bode plot: all amplitudes, and the linear model's."""
    f = screw()["frequency"].values
    lines = [Response("linear", f, linear(controller, f))]
    lines += [
        Response(f"amplitude {size:g} rad", f, value(screw(), controller, size))
        for size in AMPLITUDES[controller]
    ]
    return bode(lines)


def beside(controller: str) -> Figure:
    """Return the Bode plot of the assembled wedge's response as points on the screw's."""
    lines = []
    for size in (size for size in AMPLITUDES[controller] if size in _WEDGE):
        for label, responses, points in (("screw", screw(), False), ("wedge", wedge(), True)):
            f = responses["frequency"].values
            lines.append(
                Response(f"{label} {size:g} rad", f, value(responses, controller, size), points)
            )
    return bode(lines)
