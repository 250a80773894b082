"""Introduction: brake factor, neutral point, and stability above it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.analysis.linear.linearize import linearize
from bywire.brakes.wedge.case import swing, tag, with_friction
from bywire.brakes.wedge.figures import WedgeForces, brake_factor
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at, travel_for
from bywire.brakes.wedge.paper.statements import (
    ALLOWANCES,
    FACTS,
    IDEAL,
    MAIN,
    parameters,
    stacked,
    tan_alpha,
)
from bywire.brakes.wedge.plants import MECHANICAL_STATES
from bywire.reproduction.item import Fact, Item, compared, found, reading
from bywire.reproduction.reproduction import Exhibit, Part, Runs, kpis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COEFFICIENTS = (0.2, 0.35, 0.6)
"""coefficients below, near and above the neutral point, at which brake factors are compared"""
_TRIED = (0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6)
"""coefficients at which the actuation force is computed"""
_LOWEST, _HIGHEST = 0.32, 0.62
"""bounds of the search for the lowest coefficient at which the brake runs away"""
_GROWN = 1.05
"""ratio to the moment at power-off above which the brake is treated as having run away"""
_VARIANTS = (
    ("", "fixed", "kept"),
    (".frictionless", "fixed", "none"),
    (".known", "known", "kept"),
)
"""suffixes of ids, whether the controller uses the true mu_B, and the brake's friction"""
_FREE = {"control.offset.delta_preload": 0.0}
_HOLD = (0.1, 0.5)
"""start and end [s] of the interval in which contact changes are counted"""
_BELOW, _ABOVE = 0.2, 0.5
"""friction coefficients on both sides of the neutral point"""
_DEPTH = 5e-5
"""wedge travel [m] beyond contact at the operating point; the model is linear there"""


def part(runs: Runs) -> Part:
    """Return the comparisons on brake factor, neutral point and instability."""
    items = [*_static(runs), *_poles(), *_runaway(runs), *_closed_loop(runs), *_free_play(runs)]
    text = (
        "The paper derives the brake factor and the neutral point without friction. Without "
        "friction the model agrees with both. With friction the neutral point widens to a band in "
        "which the brake holds its position by itself. The band narrows with the load."
    )

    def pulses() -> Figure:
        return stacked(runs.bench("moment-pulses", MAIN, _at(0.6, {})).recordings["run"])

    exhibit = Exhibit(
        "unstable-region",
        pulses,
        "The test of Fig. 7 in the unstable region, at mu_B = 0.6. The motors pull the wedge back.",
    )
    return Part("Neutral point and stability", text, tuple(items), (_figure(runs), exhibit))


def _at(mu_B: float, changes: dict[str, Any]) -> dict[str, Any]:
    """Return overrides that set the pad friction in the brake and in the controller."""
    return {**with_friction(parameters(), mu_B, known=True), **changes}


def _static(runs: Runs) -> list[Item]:
    """Return brake factor and actuation force at rest, without friction."""
    values = kpis(runs.bench("static-force", MAIN, None, _sweep()))
    items = []
    for mu_B in _COEFFICIENTS:
        stated = values[f"C_star_closed_{tag(mu_B)}"]
        where = (
            "section 'Introduction': C* = 2 mu_B/(tan(alpha) - mu_B), read as its value at our "
            "wedge angle"
        )
        items.append(
            compared(
                f"stability.C.{tag(mu_B)}",
                reading(stated, "1", where),
                values[f"C_star_{tag(mu_B)}"],
                ALLOWANCES["formula"],
                f"mu_B = {mu_B:g}, simulated "
                f"without friction, F_M = {values[f'F_M_{tag(mu_B)}']:.4g} N at 500 "
                f"N·m. With friction {values[f'C_star_rising_{tag(mu_B)}']:.3g} "
                f"rising, {values[f'C_star_falling_{tag(mu_B)}']:.3g} falling",
            )
        )
    neutral = "coefficient at which the actuation force is zero, with friction, while the moment"
    return [
        *items,
        compared(
            "stability.F_M.neutral",
            FACTS["neutral_force"],
            values[f"F_M_{tag(tan_alpha())}"],
            note="simulated at mu_B = tan(alpha) without friction, at 500 N·m",
        ),
        found("stability.neutral.falling", "1", values["neutral_mu_falling"], f"{neutral} falls"),
        found("stability.neutral.rising", "1", values["neutral_mu_rising"], f"{neutral} rises"),
    ]


def _sweep() -> dict[str, Any]:
    """Return the coefficients of the static test, including the neutral point."""
    return {"mu_B": tuple(sorted((*_TRIED, tan_alpha())))}


def _figure(runs: Runs) -> Exhibit:
    values = kpis(runs.bench("static-force", MAIN, None, _sweep()))
    tried = _sweep()["mu_B"]
    # Divide by the normal force, which is M/(2 mu_B r_B) at the test moment.
    pressed = [500.0 / (2.0 * mu_B * parameters().caliper.r_B) for mu_B in tried]
    ratios = {
        name: [values[f"{name}_{tag(m)}"] / F for m, F in zip(tried, pressed, strict=True)]
        for name in ("F_M", "F_M_rising", "F_M_falling")
    }
    forces = WedgeForces(tried, *ratios.values())
    return Exhibit(
        "brake-factor",
        lambda: brake_factor(forces, tan_alpha()),
        "Actuation force and brake factor at 500 N·m versus pad friction coefficient.",
    )


def _runaway(runs: Runs) -> list[Item]:
    """Return the lowest friction coefficient that pulls the wedge in without power."""
    where = "section 'Introduction': unstable above the ideal point, mu_B = tan(alpha)"
    stated = Fact(tan_alpha(), "1", where)
    note = "lowest tested mu_B at which the moment grows by itself when the power goes off at"
    high = FACTS["pulse"].value
    return [
        compared(
            "stability.runaway",
            stated,
            _lowest(runs, IDEAL, 500.0),
            ALLOWANCES["grid"],
            f"{note} 500 N·m, without friction",
        ),
        compared(
            "stability.runaway.friction",
            stated,
            _lowest(runs, {"flywheel.runout": 0.0}, 500.0),
            ALLOWANCES["grid"],
            f"{note} 500 N·m, with friction",
        ),
        found(
            "stability.runaway.friction.950",
            "1",
            _lowest(runs, {"flywheel.runout": 0.0}, high),
            f"{note} {high:g} N·m, with friction",
        ),
    ]


def _lowest(runs: Runs, changes: dict[str, Any], M_hold: float) -> float:
    """Return the lowest coefficient of a grid at which the moment grows, from a bisection.

    NaN if the moment grows at the lowest coefficient, or does not grow at the highest.
    """

    def grows(k: int) -> bool:
        overrides = _at(round(_LOWEST + k * ALLOWANCES["grid"].size, 3), changes)
        values = kpis(runs.bench("power-off-hold", MAIN, overrides, {"M_hold": M_hold}))
        met_stop = values["end_stop_force"] > 0.0
        return met_stop or values["moment_end"] > _GROWN * values["moment_start"]

    low, high = 0, round((_HIGHEST - _LOWEST) / ALLOWANCES["grid"].size)
    if grows(low) or not grows(high):
        return math.nan
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return round(_LOWEST + high * ALLOWANCES["grid"].size, 3)


def _closed_loop(runs: Runs) -> list[Item]:
    """Return stability and overshoot of the closed loop over all coefficients."""
    items: list[Item] = []
    for suffix, slope, friction in _VARIANTS:
        values = kpis(
            runs.bench("friction-sweep", MAIN, None, {"slope": slope, "friction": friction})
        )
        belief = "knows" if slope == "known" else "does not know"
        note = f"200 N·m, friction {friction}. The controller {belief} mu_B"
        items += [
            compared(
                f"stability.unstable{suffix}",
                FACTS["stable"],
                values["unstable"],
                note=f"coefficients at which the hold does not settle; {note}",
            ),
            found(
                f"stability.overshoot{suffix}",
                "%",
                values["overshoot_max"],
                f"maximum over all coefficients; {note}",
            ),
            found(
                f"stability.hold_power{suffix}",
                "W",
                values["hold_power_max"],
                f"maximum over all coefficients, including standby; {note}",
            ),
        ]
    return items


def _free_play(runs: Runs) -> list[Item]:
    """Return the contact changes at the neutral point, with preload and with free play."""
    shaking = {"flywheel.runout": parameters().flywheel.runout}
    held = {}
    for name, preload in (("preload", {}), ("free_play", _FREE)):
        overrides = _at(tan_alpha(), {**IDEAL, **shaking, **preload})
        held[name] = runs.bench("moment-pulses", MAIN, overrides).recordings["run"]
    changes = {
        name: int(np.count_nonzero(np.diff(run["contacts"].sel(time=slice(*_HOLD)).values)))
        for name, run in held.items()
    }
    note = "contact changes from sample to sample in 0.4 s of a hold at tan(alpha), no friction"
    return [
        compared(
            "stability.contact_changes",
            FACTS["no_play"],
            float(changes["preload"]),
            note=f"{note}, preload from the parameter set",
        ),
        found(
            "stability.contact_changes.free_play",
            "1",
            float(changes["free_play"]),
            f"{note}, no preload",
        ),
        *(
            found(
                f"stability.ripple.{name}",
                "N*m",
                swing(run, "M_B", *_HOLD),
                "peak-to-peak moment during the same hold",
            )
            for name, run in held.items()
        ),
    ]


def _poles() -> list[Item]:
    """Return the slow open-loop poles at constant currents, without friction and cogging."""
    note = "linear model at constant currents, without friction and cogging, mu_B ="
    below, neutral, above = (_slow_pole(mu_B) for mu_B in (_BELOW, tan_alpha(), _ABOVE))
    return [
        compared(
            "stability.pole.neutral",
            FACTS["neutral_pole"],
            neutral.real,
            note=f"maximum growth rate, {note} tan(alpha)",
        ),
        compared(
            "stability.pole.above",
            FACTS["unstable_pole"],
            above.real,
            note=f"maximum growth rate, {note} {_ABOVE:g}",
        ),
        compared(
            "stability.pole.below",
            FACTS["stable_pole"],
            below.real,
            note=f"maximum growth rate, {note} {_BELOW:g}",
        ),
        found(
            "stability.swing.below",
            "rad/s",
            below.imag,
            f"frequency of the slow pole pair, {note} {_BELOW:g}",
        ),
    ]


def _slow_pole(mu_B: float) -> complex:
    """Return the slow pole with the highest growth rate [1/s], of a pair the upper one."""
    par = parameters().replace({**IDEAL, "command.mode": "current", "wedge.mu_B": mu_B})
    state = state_at(travel_for(0.0, par) + _DEPTH, par)
    model = linearize(
        WedgeBrake(), par, state, memory_at(state.x, par), inputs=("i_1_ref",), outputs=("x",)
    )
    # Hold the current loops, and the disc with its sensors, because they do not feed back.
    every = model.reduced(MECHANICAL_STATES, held=True).poles()
    slow = every[np.argsort(np.abs(every))][:2]
    return complex(max(slow, key=lambda s: (round(s.real, 6), s.imag)))
