"""Fig. 5: position frequency response of the low-bandwidth controller."""

from __future__ import annotations

import numpy as np

from bywire.brakes.wedge.paper import frequency
from bywire.brakes.wedge.paper.facts import FACTS
from bywire.brakes.wedge.paper.runs import parameters
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, Runs

_LOW = "low"


def part(runs: Runs) -> Part:
    """Return the responses by amplitude, and what friction takes off them."""
    runs.report("Fig. 5: sweep", 0.0)
    shares = [
        float(frequency.of(frequency.screw(), _LOW, size)["share_sat_current"].max())
        for size in frequency.AMPLITUDES[_LOW]
    ]
    gain, phase = frequency.without_friction(_LOW)
    preload, nearest = frequency.nearest_preload()
    items = [
        compared(
            "fig5.limit",
            FACTS["no_limit"],
            100.0 * max(shares),
            note="largest share over frequencies and amplitudes",
        ),
        *friction(_LOW, "fig5"),
        *_low_frequency(),
        compared("fig5.linear.gain", FACTS["same_gain"], gain, note="1 to 100 Hz"),
        compared("fig5.linear.phase", FACTS["same_phase"], phase, note="1 to 100 Hz"),
        compared(
            "fig5.wedge",
            FACTS["little"],
            frequency.apart(_LOW),
            note="largest distance of both responses, amplitudes of 0.5 and 1 rad",
        ),
        found(
            "fig5.wedge.preload",
            "N",
            preload,
            "preload of the screw alone that comes closest "
            f"to the wedge, of 25, 50, 75, 100 N; ours is {parameters().rig.F_0:g} N",
        ),
        found("fig5.wedge.nearest", "%", nearest, "largest distance with that preload"),
    ]
    text = (
        "A controller of 12 Hz on the preloaded screw, at 0.5, 1 and 2 rad: all three, and the "
        "bandwidth, are our choice. 0.25 rad sticks at all frequencies."
    )
    exhibits = (
        Exhibit(
            "fig5",
            lambda: frequency.figure(_LOW),
            "Fig. 5: position frequency response, low bandwidth controller.",
        ),
        Exhibit(
            "fig5-wedge",
            lambda: frequency.beside(_LOW),
            "The assembled wedge beside the screw, low bandwidth controller.",
        ),
    )
    return Part(
        "Figure 5: position response, low bandwidth",
        text,
        tuple(items),
        exhibits,
        {"frequency-response-screw": frequency.screw()},
    )


def friction(controller: str, figure: str) -> list[Item]:
    """Return what friction takes off the response at the lowest frequency."""
    items: list[Item] = []
    sweep = frequency.screw()
    f = sweep["frequency"].values
    linear = frequency.linear(controller, f)
    sizes = frequency.AMPLITUDES[controller]
    away = 100.0 * float(np.abs(frequency.value(sweep, controller, sizes[0])[0] - linear[0]))
    items.append(
        compared(
            f"{figure}.friction", FACTS["friction_seen"], away, note=f"amplitude {sizes[0]:g} rad"
        )
    )
    for size in sizes:
        value = frequency.value(sweep, controller, size)
        lost = frequency.decibels(value / linear)
        late = np.degrees(np.angle(value / linear))
        items.append(
            found(
                f"{figure}.friction.{size:g}",
                "dB",
                float(lost[0]),
                f"gain at 1 Hz less that of the linear loop, amplitude {size:g} rad; "
                f"phase {late[0]:.2g} degree",
            )
        )
    return items


def _low_frequency() -> list[Item]:
    """Return whether friction shows at low frequency in particular, and where it shows most."""
    sweep = frequency.screw()
    f = sweep["frequency"].values
    lost = np.array(
        [
            frequency.decibels(frequency.linear(_LOW, f) / frequency.value(sweep, _LOW, size))
            for size in frequency.AMPLITUDES[_LOW]
        ]
    )
    return [
        compared(
            "fig5.friction.low_frequency",
            FACTS["friction_low"],
            float((lost[:, 0] / lost[:, -1]).min()),
            note="smallest ratio of all amplitudes",
        ),
        found(
            "fig5.friction.most",
            "Hz",
            float(f[lost[-1].argmax()]),
            f"where the gain loses most at 2 rad, {lost[-1].max():.3g} dB; {lost[-1][0]:.2g} dB "
            "at 1 Hz: around its own bandwidth the loop is least stiff",
        ),
    ]
