"""Figs. 5 and 6: position frequency responses with both controllers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.crossings import bandwidth
from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep, amplitudes
from bywire.brakes.wedge.paper.statements import FACTS, parameters
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.report.response_figures import Response, bode
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs
from bywire.simulation.run import simulate

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_LOW = "low"


def fig5(runs: Runs) -> Part:
    """Return the responses at each amplitude, and the loss due to friction."""
    runs.report("Fig. 5: sweep", 0.0)
    shares = [
        float(_responses_at(_screw_responses(), _LOW, size)["share_sat_current"].max())
        for size in _AMPLITUDES[_LOW]
    ]
    gain, phase = _without_friction(_LOW)
    preload, nearest = _nearest_preload()
    items = [
        compared(
            "fig5.limit",
            FACTS["no_limit"],
            100.0 * max(shares),
            note="maximum fraction over frequencies and amplitudes",
        ),
        *_friction_loss(_LOW, "fig5"),
        *_low_frequency(),
        compared("fig5.linear.gain", FACTS["same_gain"], gain, note="1 to 100 Hz"),
        compared("fig5.linear.phase", FACTS["same_phase"], phase, note="1 to 100 Hz"),
        compared(
            "fig5.wedge",
            FACTS["little"],
            _largest_distance(_LOW),
            note="maximum distance between the two responses, at amplitudes of 0.5 and 1 rad",
        ),
        found(
            "fig5.wedge.preload",
            "N",
            preload,
            "preload of the screw alone at which it comes closest to the wedge. Tested: 25, 50, "
            f"75, 100 N; ours is {parameters().rig.F_0:g} N",
        ),
        found("fig5.wedge.nearest", "%", nearest, "maximum distance with that preload"),
    ]
    text = (
        "A 12 Hz controller moves the preloaded screw with amplitudes of 0.5, 1 and 2 rad. We "
        "chose the bandwidth and the amplitudes. At 0.25 rad the screw sticks at all frequencies."
    )
    exhibits = (
        Exhibit(
            "fig5",
            lambda: _bode(_LOW),
            "Fig. 5: position frequency response, low-bandwidth controller.",
        ),
        Exhibit(
            "fig5-wedge",
            lambda: _comparison(_LOW),
            "Assembled wedge compared with the screw, low-bandwidth controller.",
        ),
    )
    return Part(
        "Figure 5: position response, low bandwidth",
        text,
        tuple(items),
        exhibits,
        {"frequency-response-screw": _screw_responses()},
    )


def _friction_loss(controller: str, figure: str) -> list[Item]:
    """Return the loss due to friction at the lowest frequency."""
    items: list[Item] = []
    sweep = _screw_responses()
    f = sweep["frequency"].values
    linear = _linear_response(controller, f)
    sizes = _AMPLITUDES[controller]
    away = 100.0 * float(np.abs(_response_of(sweep, controller, sizes[0])[0] - linear[0]))
    items.append(
        compared(
            f"{figure}.friction", FACTS["friction_seen"], away, note=f"amplitude {sizes[0]:g} rad"
        )
    )
    for size in sizes:
        value = _response_of(sweep, controller, size)
        lost = _decibels(value / linear)
        late = np.degrees(np.angle(value / linear))
        items.append(
            found(
                f"{figure}.friction.{size:g}",
                "dB",
                float(lost[0]),
                f"gain at 1 Hz minus the gain of the linear loop, amplitude {size:g} rad; "
                f"phase difference {late[0]:.2g} degree",
            )
        )
    return items


def _low_frequency() -> list[Item]:
    """Return the loss due to friction at low frequency, and the frequency of the maximum loss."""
    sweep = _screw_responses()
    f = sweep["frequency"].values
    lost = np.array(
        [
            _decibels(_linear_response(_LOW, f) / _response_of(sweep, _LOW, size))
            for size in _AMPLITUDES[_LOW]
        ]
    )
    return [
        compared(
            "fig5.friction.low_frequency",
            FACTS["friction_low"],
            float((lost[:, 0] / lost[:, -1]).min()),
            note="minimum ratio over all amplitudes",
        ),
        found(
            "fig5.friction.most",
            "Hz",
            float(f[lost[-1].argmax()]),
            f"frequency of the maximum gain loss at 2 rad: {lost[-1].max():.3g} dB, compared "
            f"with {lost[-1][0]:.2g} dB at 1 Hz. The loop is least stiff around its bandwidth",
        ),
    ]


# --- Fig. 6: the high-bandwidth controller

_HIGH = "high"
_SMALL = 0.1  # rad: below the current limit up to 60 Hz with a lossless screw
_SEEN = (1.0, 10.0, 60.0, 100.0)  # Hz
_SHAKEN, _BELOW, _ABOVE = 1.0, 20.0, 30.0  # rad, Hz, Hz: where one sine has two responses
_T_FALL, _T_SEEN = 3.0, 1.0  # s
_LAWS = {
    "load": "friction proportional to axial force",
    "drive": "loss proportional to motor torque",
}

Complex = NDArray[np.complex128]


def fig6(runs: Runs) -> Part:
    """Return the responses at each amplitude, the current limit and the screw efficiency."""
    gain, phase = _without_friction(_HIGH)
    runs.report("Fig. 6: current limit, efficiency", 0.5)
    items = [
        *_current_limit(),
        *_jump(),
        *_friction_loss(_HIGH, "fig6"),
        *_efficiency(),
        compared("fig6.linear.gain", FACTS["same_gain"], gain, note="1 to 100 Hz"),
        compared("fig6.linear.phase", FACTS["same_phase"], phase, note="1 to 100 Hz"),
        compared(
            "fig6.wedge",
            FACTS["little"],
            _largest_distance(_HIGH),
            note="maximum distance between the two responses, at amplitudes of 0.25, 0.5 and 1 rad",
        ),
        found(
            "fig6.wedge.below_limit",
            "%",
            _largest_distance(_HIGH, limited=False),
            "the same distance where the screw does not reach the current limit",
        ),
    ]
    text = (
        "A 60 Hz controller moves the preloaded screw with amplitudes of 0.25, 0.5 and 1 rad. We "
        "chose the bandwidth and the amplitudes. Every sine starts from rest. Just below the "
        "frequency where the limit begins, a downward sweep would give a different response. The "
        "measured curves are not available, so theory and practice cannot be compared."
    )
    exhibits = (
        Exhibit(
            "fig6",
            lambda: _bode(_HIGH),
            "Fig. 6: position frequency response, high-bandwidth controller.",
        ),
        Exhibit(
            "fig6-wedge",
            lambda: _comparison(_HIGH),
            "Assembled wedge compared with the screw, high-bandwidth controller.",
        ),
    )
    return Part(
        "Figure 6: position response, high bandwidth",
        text,
        tuple(items),
        exhibits,
        {"frequency-response-wedge": _wedge_responses()},
    )


def _current_limit() -> list[Item]:
    """Return the onset frequencies of the current limit, and its effect on gain and phase."""
    f = _screw_responses()["frequency"].values
    model = LOOPS.find("screw-position").closed(_parameters_with(_HIGH), 0.0)
    wide = bandwidth(lambda g: model.response(g)[:, 0, 0], (0.5, 500.0))
    falls = -np.diff(np.degrees(np.unwrap(np.angle(_linear_response(_HIGH, f)))))
    onsets, kinks, each = [], [], list[Item]()
    for size in _AMPLITUDES[_HIGH]:
        response = _responses_at(_screw_responses(), _HIGH, size)
        limited = np.flatnonzero(response["share_sat_current"].values > 0)
        onset = float(f[limited[0]]) if limited.size else math.inf
        drops = -np.diff(response["phase"].values)
        k = int(np.argmax(drops / falls))
        onsets.append(onset)
        kinks.append(float(drops[k] / falls[k]))
        slope = _slope(f, _decibels(_response_of(_screw_responses(), _HIGH, size)))
        each += [
            found(
                f"fig6.onset.{size:g}",
                "Hz",
                onset,
                f"first of 40 frequencies at which the demand reaches the limit, {size:g} rad",
            ),
            found(
                f"fig6.kink.{size:g}",
                "degree",
                float(drops[k]),
                f"phase drop from {f[k]:.3g} to {f[k + 1]:.3g} Hz at {size:g} rad; "
                f"{falls[k]:.2g} degree in the linear loop",
            ),
            found(
                f"fig6.roll_off.{size:g}",
                "dB",
                slope,
                f"gain per decade over the last five frequencies, {size:g} rad",
            ),
        ]
    return [
        compared(
            "fig6.limit",
            FACTS["limited"],
            max(onsets) / wide,
            note="maximum ratio over all amplitudes. The linear loop falls to -3 dB at "
            f"{wide:.3g} Hz",
        ),
        compared("fig6.kink", FACTS["kink"], min(kinks), note="minimum ratio over all amplitudes"),
        *each,
    ]


def _slope(f: Array, gain: Array) -> float:
    return float(np.polyfit(np.log10(f[-5:]), gain[-5:], 1)[0])


def _efficiency() -> list[Item]:
    """Return the effect of the screw loss on the wedge's response, for both readings."""
    ideal, load = _wedge("load")
    _, drive = _wedge("drive")
    items: list[Item] = []
    for law, lossy in (("load", load), ("drive", drive)):
        lost = _decibels(ideal / lossy)
        note = f"{_LAWS[law]}, amplitude {_SMALL:g} rad"
        items += [
            compared(
                f"fig6.efficiency.{law}",
                FACTS["efficiency_high"],
                float(lost[-1] / lost[1]),
                note=note,
            ),
            *(
                found(
                    f"fig6.efficiency.{law}.{f:g}",
                    "dB",
                    float(-lost[k]),
                    f"gain at {f:g} Hz minus the gain with a lossless screw; {note}",
                )
                for k, f in enumerate(_SEEN)
            ),
        ]
    return items


def _wedge(law: str) -> tuple[Complex, Complex]:
    """Return the assembled wedge's response with a lossless screw and with a lossy one."""
    loop, par = LOOPS.find("position"), _parameters_with(_HIGH).replace({"screw.law": law})
    leaves = par.leaves()
    sweep = Sweep(
        loop.inputs,
        loop.output,
        _SEEN,
        (_SMALL,),
        {name: [1.0, leaves[name]] for name in ("screw.eta_f", "screw.eta_b")},
        flags=(),
    )
    measured = frequency_response(loop.point(par, 0.0).run(), sweep).isel(amplitude=0)
    values = measured["gain"].values * np.exp(1j * np.radians(measured["phase"].values))
    return values[0], values[1]


def _jump() -> list[Item]:
    """Return the gain after a start from rest, and after the frequency fell from above."""
    return [
        found(
            "fig6.jump.from_rest",
            "1",
            _gain(_BELOW),
            f"gain at {_BELOW:g} Hz and {_SHAKEN:g} rad from rest. The loop stays below the limit",
        ),
        found(
            "fig6.jump.from_above",
            "1",
            _gain(_ABOVE),
            "the same gain after the frequency fell from "
            f"{_ABOVE:g} Hz within {_T_FALL:g} s. The loop stays on the limit",
        ),
    ]


def _gain(begin: float) -> float:
    slope = (_BELOW - begin) / _T_FALL
    at_end = 0.5 * (begin + _BELOW) * _T_FALL

    def stimulus(t: Array) -> Array:
        falling = begin * t + 0.5 * slope * t * t
        turns = np.where(t < _T_FALL, falling, at_end + _BELOW * (t - _T_FALL))
        return np.column_stack([_SHAKEN * np.sin(2.0 * math.pi * turns), 0.0 * t])

    run = LOOPS.find("screw-position").point(_parameters_with(_HIGH), 0.0).run()
    run = replace(run, stimulus=stimulus, duration=_T_FALL + _T_SEEN)
    seen = simulate(run, ("theta_1",))
    inside = (seen.time > _T_FALL - 1e-9) & (seen.time < _T_FALL + _T_SEEN - 1e-9)
    angle = seen["theta_1"][inside]
    line = amplitudes(seen.time[inside], angle, _BELOW, 1)[0]
    return float(np.abs(line)) / _SHAKEN


# --- The responses of both figures

_BANDWIDTHS = {"low": 12.0, "high": 60.0}
"""natural frequencies of the two position controllers [Hz]"""
_AMPLITUDES = {"low": (0.5, 1.0, 2.0), "high": (0.25, 0.5, 1.0)}
"""amplitudes shown for each controller [rad]"""
_FREQUENCIES = tuple(np.geomspace(1.0, 100.0, 40).tolist())
_BOTH = tuple(sorted({size for sizes in _AMPLITUDES.values() for size in sizes}))
_WEDGE = (0.25, 0.5, 1.0)  # larger amplitudes would reach the disc
_PRELOADS = (25.0, 50.0, 75.0, 100.0)  # N
_PATIENCE = 12  # maximum windows: with friction, encoder and cogging they may never repeat


@cache
def _screw_responses() -> xr.Dataset:
    """Return the preloaded screw's responses with both controllers at all amplitudes."""
    return _swept("screw-position", _FREQUENCIES, _BOTH, ("stuck", "sat_current"))


@cache
def _wedge_responses() -> xr.Dataset:
    """Return the assembled wedge's responses, at every third frequency."""
    return _swept("position", _FREQUENCIES[::3], _WEDGE, ("stuck",))


def _swept(
    name: str, frequencies: tuple[float, ...], amplitudes: tuple[float, ...], flags: tuple[str, ...]
) -> xr.Dataset:
    loop = LOOPS.find(name)
    sweep = Sweep(
        loop.inputs,
        loop.output,
        frequencies,
        amplitudes,
        {"control.position.f_n": list(_BANDWIDTHS.values())},
        flags=flags,
        most=_PATIENCE,
    )
    responses = frequency_response(loop.point(parameters(), 0.0).run(), sweep)
    return responses.assign_coords(controller=("variant", list(_BANDWIDTHS)))


def _responses_at(responses: xr.Dataset, controller: str, size: float) -> xr.Dataset:
    """Return the response of one controller at one amplitude [rad], versus frequency."""
    return responses.isel(variant=list(_BANDWIDTHS).index(controller)).sel(amplitude=size)


def _response_of(responses: xr.Dataset, controller: str, size: float) -> Complex:
    """Return a complex response, shape (frequencies,); NaN where the output sticks."""
    figures = _responses_at(responses, controller, size)
    return np.asarray(figures["gain"].values * np.exp(1j * np.radians(figures["phase"].values)))


def _parameters_with(controller: str) -> ParameterSet:
    """Return the parameter set with one of the controllers."""
    return parameters().replace({"control.position.f_n": _BANDWIDTHS[controller]})


def _linear_response(controller: str, frequencies: Array) -> Complex:
    """Return the response of the screw's linear model, without friction and current limit."""
    loop = LOOPS.find("screw-position")
    return loop.closed(_parameters_with(controller), 0.0).response(frequencies)[:, 0, 0]


def _decibels(response: Complex) -> Array:
    """Return magnitudes in dB."""
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _without_friction(controller: str) -> tuple[float, float]:
    """Return the maximum differences of the nonlinear and linear responses, dB and degree.

    Friction, cogging and the encoder's resolution are off, and the amplitude is below the current
    limit.
    """
    loop = LOOPS.find("screw-position")
    smooth = loop.smooth(_parameters_with(controller))
    sweep = Sweep(
        loop.inputs, loop.output, _FREQUENCIES[::4], loop.amplitudes[:1], flags=(), tolerance=1e-4
    )
    response = frequency_response(loop.point(smooth, 0.0).run(), sweep).squeeze()
    measured = response["gain"].values * np.exp(1j * np.radians(response["phase"].values))
    ratio = measured / _linear_response(controller, response["frequency"].values)
    return float(np.abs(_decibels(ratio)).max()), float(np.abs(np.degrees(np.angle(ratio))).max())


def _largest_distance(controller: str, *, limited: bool = True) -> float:
    """Return the maximum distance of the wedge's response from the screw's, % of the amplitude.

    ``limited``: include frequencies at which the screw reaches the current limit.
    """
    ours = _screw_responses().sel(frequency=_wedge_responses()["frequency"])
    largest = 0.0
    for size in (size for size in _AMPLITUDES[controller] if size in _WEDGE):
        free = _responses_at(ours, controller, size)["share_sat_current"].values == 0
        away = np.abs(
            _response_of(_wedge_responses(), controller, size)
            - _response_of(ours, controller, size)
        )
        largest = max(largest, float(away[free | limited].max()))
    return 100.0 * largest


def _nearest_preload() -> tuple[float, float]:
    """Return the screw preload [N] that comes closest to the wedge, and the distance [%].

    Uses the low-bandwidth controller, and the amplitudes and frequencies of the wedge's responses.
    """
    sizes = tuple(size for size in _AMPLITUDES["low"] if size in _WEDGE)
    loop = LOOPS.find("screw-position")
    sweep = Sweep(
        loop.inputs,
        loop.output,
        _FREQUENCIES[::3],
        sizes,
        {"rig.F_0": list(_PRELOADS)},
        flags=(),
        most=_PATIENCE,
    )
    responses = frequency_response(loop.point(_parameters_with("low"), 0.0).run(), sweep)
    values = responses["gain"].values * np.exp(1j * np.radians(responses["phase"].values))
    of_wedge = np.array([_response_of(_wedge_responses(), "low", size) for size in sizes])
    away = np.abs(values - of_wedge).max(axis=(1, 2))
    k = int(away.argmin())
    return _PRELOADS[k], 100.0 * float(away[k])


def _bode(controller: str) -> Figure:
    """Return the Bode plot of all amplitudes and the linear model."""
    f = _screw_responses()["frequency"].values
    lines = [Response("linear", f, _linear_response(controller, f))]
    lines += [
        Response(f"amplitude {size:g} rad", f, _response_of(_screw_responses(), controller, size))
        for size in _AMPLITUDES[controller]
    ]
    return bode(lines)


def _comparison(controller: str) -> Figure:
    """Return the Bode plot of the screw's responses, with the wedge's responses as points."""
    lines = []
    for size in (size for size in _AMPLITUDES[controller] if size in _WEDGE):
        for label, responses, points in (
            ("screw", _screw_responses(), False),
            ("wedge", _wedge_responses(), True),
        ):
            f = responses["frequency"].values
            lines.append(
                Response(
                    f"{label} {size:g} rad", f, _response_of(responses, controller, size), points
                )
            )
    return bode(lines)
