"""Fig. 6: position frequency response of the high-bandwidth controller."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.crossings import bandwidth
from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.harmonics import amplitudes
from bywire.analysis.response.sweep import Sweep
from bywire.brakes.wedge.paper import frequency
from bywire.brakes.wedge.paper.facts import FACTS
from bywire.brakes.wedge.paper.fig5 import friction
from bywire.core.typing import Array
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs
from bywire.simulation.run import simulate

_HIGH = "high"
_SMALL = 0.1  # rad: clear of the current limit up to 60 Hz where the screw loses nothing
_SEEN = (1.0, 10.0, 60.0, 100.0)  # Hz
_SHAKEN, _BELOW, _ABOVE = 1.0, 20.0, 30.0  # rad, Hz, Hz: where two responses answer one sine
_T_FALL, _T_SEEN = 3.0, 1.0  # s
_LAWS = {"load": "friction by the axial force", "drive": "loss by the motor's torque"}

Complex = NDArray[np.complex128]


def part(runs: Runs) -> Part:
    """Return the responses by amplitude, the current limit and the screw's efficiency."""
    gain, phase = frequency.without_friction(_HIGH)
    runs.report("Fig. 6: current limit, efficiency", 0.5)
    items = [
        *_limit(),
        *_jump(),
        *friction(_HIGH, "fig6"),
        *_efficiency(),
        compared("fig6.linear.gain", FACTS["same_gain"], gain, note="1 to 100 Hz"),
        compared("fig6.linear.phase", FACTS["same_phase"], phase, note="1 to 100 Hz"),
        compared(
            "fig6.wedge",
            FACTS["little"],
            frequency.apart(_HIGH),
            note="largest distance of both responses, amplitudes of 0.25, 0.5 and 1 rad",
        ),
        found(
            "fig6.wedge.below_limit",
            "%",
            frequency.apart(_HIGH, limited=False),
            "the same where the screw does not reach the current limit",
        ),
    ]
    text = (
        "A controller of 60 Hz on the preloaded screw, at 0.25, 0.5 and 1 rad: all three, and the "
        "bandwidth, are our choice. Every sine starts from rest: just below where the limit "
        "sets in, a sweep that comes from above finds another response. Whether theory and "
        "practice match cannot be judged: the measured curves are not at hand."
    )
    exhibits = (
        Exhibit(
            "fig6",
            lambda: frequency.figure(_HIGH),
            "Fig. 6: position frequency response, high bandwidth controller.",
        ),
        Exhibit(
            "fig6-wedge",
            lambda: frequency.beside(_HIGH),
            "The assembled wedge beside the screw, high bandwidth controller.",
        ),
    )
    return Part(
        "Figure 6: position response, high bandwidth",
        text,
        tuple(items),
        exhibits,
        {"frequency-response-wedge": frequency.wedge()},
    )


def _limit() -> list[Item]:
    """Return where the current limit sets in, and what it does to gain and phase."""
    f = frequency.screw()["frequency"].values
    model = LOOPS.find("screw-position").closed(frequency.changed(_HIGH), 0.0)
    wide = bandwidth(lambda g: model.response(g)[:, 0, 0], (0.5, 500.0))
    falls = -np.diff(np.degrees(np.unwrap(np.angle(frequency.linear(_HIGH, f)))))
    onsets, kinks, each = [], [], list[Item]()
    for size in frequency.AMPLITUDES[_HIGH]:
        response = frequency.of(frequency.screw(), _HIGH, size)
        limited = np.flatnonzero(response["share_sat_current"].values > 0)
        onset = float(f[limited[0]]) if limited.size else math.inf
        drops = -np.diff(response["phase"].values)
        k = int(np.argmax(drops / falls))
        onsets.append(onset)
        kinks.append(float(drops[k] / falls[k]))
        slope = _slope(f, frequency.decibels(frequency.value(frequency.screw(), _HIGH, size)))
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
                f"fall of the phase from {f[k]:.3g} to {f[k + 1]:.3g} Hz at {size:g} rad; "
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
            note="largest ratio of all amplitudes; the linear loop falls to -3 dB at "
            f"{wide:.3g} Hz",
        ),
        compared("fig6.kink", FACTS["kink"], min(kinks), note="smallest ratio of all amplitudes"),
        *each,
    ]


def _slope(f: Array, gain: Array) -> float:
    return float(np.polyfit(np.log10(f[-5:]), gain[-5:], 1)[0])


def _efficiency() -> list[Item]:
    """Return what the screw's loss takes off the wedge's response, by both readings of it."""
    ideal, load = _wedge("load")
    _, drive = _wedge("drive")
    items: list[Item] = []
    for law, lossy in (("load", load), ("drive", drive)):
        lost = frequency.decibels(ideal / lossy)
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
                    f"gain at {f:g} Hz less that of a screw without loss; {note}",
                )
                for k, f in enumerate(_SEEN)
            ),
        ]
    return items


def _wedge(law: str) -> tuple[Complex, Complex]:
    """Return the assembled wedge's response with a screw without loss, and with its own."""
    loop, par = LOOPS.find("position"), frequency.changed(_HIGH).replace({"screw.law": law})
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
            f"gain at {_BELOW:g} Hz and {_SHAKEN:g} rad, from rest: below the limit",
        ),
        found(
            "fig6.jump.from_above",
            "1",
            _gain(_ABOVE),
            "the same after the frequency fell from "
            f"{_ABOVE:g} Hz within {_T_FALL:g} s: the loop stays on the limit",
        ),
    ]


def _gain(begin: float) -> float:
    slope = (_BELOW - begin) / _T_FALL
    at_end = 0.5 * (begin + _BELOW) * _T_FALL

    def stimulus(t: Array) -> Array:
        falling = begin * t + 0.5 * slope * t * t
        turns = np.where(t < _T_FALL, falling, at_end + _BELOW * (t - _T_FALL))
        return np.column_stack([_SHAKEN * np.sin(2.0 * math.pi * turns), 0.0 * t])

    run = LOOPS.find("screw-position").point(frequency.changed(_HIGH), 0.0).run()
    run = replace(run, stimulus=stimulus, duration=_T_FALL + _T_SEEN)
    seen = simulate(run, ("theta_1",))
    inside = (seen.time > _T_FALL - 1e-9) & (seen.time < _T_FALL + _T_SEEN - 1e-9)
    angle = seen["theta_1"][inside]
    line = amplitudes(seen.time[inside], angle, _BELOW, 1)[0]
    return float(np.abs(line)) / _SHAKEN
