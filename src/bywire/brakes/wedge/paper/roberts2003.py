"""Reproduction of Roberts, Schautt, Hartmann, Gombert (2003): Figs. 5 to 9, rigs, statements."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.brakes.wedge.paper import frequency_responses, hold, moment_tests, rigs, stability
from bywire.brakes.wedge.paper.statements import ALLOWANCES, CITATION, MAIN
from bywire.reproduction.item import Item, Quoted, RootCause, causes_of
from bywire.reproduction.reproduction import Reproduction, Runs, Source, reproduced

PARTS = {
    "neutral point": stability.part,
    "current loop": rigs.current_loop,
    "efficiency": rigs.efficiency,
    "stiffness": rigs.stiffness,
    "Fig. 5": frequency_responses.fig5,
    "Fig. 6": frequency_responses.fig6,
    "position": rigs.position,
    "force fight": rigs.force_fight,
    "Fig. 7": moment_tests.fig7,
    "Fig. 8": moment_tests.fig8,
    "Fig. 9": moment_tests.fig9,
    "holding": hold.part,
}

_ADVICE = (
    "The disagreements come from friction and from values that the paper does not print, such as "
    "the preload and the length of a pulse, and not from its equations. Responses to large steps, "
    "hold powers and moments are suitable for studies. Vary the preload and the friction if your "
    "result depends on small motions or on the position at which a shaft comes to rest."
)
SOURCE = Source(
    name=MAIN,
    summary="self-reinforcing wedge brake with two motors, SAE 2003",
    reproduce=lambda progress: reproduced(
        Reproduction(
            MAIN,
            CITATION,
            allowances=tuple(ALLOWANCES.values()),
            sets={"": "Our parameter set"},
            advice=_ADVICE,
        ),
        Runs(progress),
        PARTS,
        causes,
    ),
)
reproduce = SOURCE.reproduce


# --- Root causes of disagreements, with numbers


def causes(items: Iterable[Item]) -> tuple[RootCause, ...]:
    """Return the root causes, with numbers from the items."""
    return causes_of(
        items, _neutral_band, _pulse_length, _bearings, _dead_band, _preload, _limit, _stiff_loop
    )


def _neutral_band(q: Quoted) -> RootCause:
    return RootCause(
        "The paper's instability above mu_B = tan(alpha) neglects friction. Without "
        f"friction the brake runs away above {q('stability.runaway')} "
        f"({q.stated('stability.runaway')} stated). Dry friction in bearings, "
        "screws and wedge holds the brake without power below "
        f"{q('stability.runaway.friction')} at 500 N·m and "
        f"{q('stability.runaway.friction.950')} at 950 N·m.",
        ("stability.runaway.friction",),
    )


def _pulse_length(q: Quoted) -> RootCause:
    return RootCause(
        "The paper does not print the length of the pulse in Fig. 9. Within our 0.2 s the "
        f"filtered power above standby falls to {q('fig9.lowest_power')} times the hold power of "
        "Fig. 7, which the paper does not report. In a pulse that ends at 90 % of the moment, "
        f"the power falls to {q('fig9.lowest_power.short')} times the hold power.",
        ("fig9.lowest_power",),
    )


def _bearings(q: Quoted) -> RootCause:
    return RootCause(
        "Motor torque and force alone do not give the screw efficiency. Including bearing "
        f"friction, the rig measures {q('efficiency.raw')} where "
        f"{q.stated('efficiency.raw')} is true. After the no-load bearing torque is subtracted, "
        f"the rig gives {q('efficiency.recovered')}. The remaining difference is bearing friction "
        "under load, which no sensor of the rig can separate from screw friction.",
        ("efficiency.*",),
    )


def _dead_band(q: Quoted) -> RootCause:
    return RootCause(
        "Position steps end where friction holds the shaft. With the soft low-bandwidth "
        f"controller a shaft can come to rest {q('position.dead_band.low')} from its "
        "reference, and the preload that remains with the wedge determines where. The "
        "wedge's response then differs from the screws' response by "
        f"{q('position.wedge.low')} of the step. With the high-bandwidth controller the "
        f"difference is only {q('position.wedge.high')}, because friction holds only "
        f"{q('position.dead_band.high')}.",
        ("position.wedge.*",),
    )


def _preload(q: Quoted) -> RootCause:
    return RootCause(
        "The low-bandwidth controller is too soft to maintain the wedge's preload. The "
        f"wedge responds like a screw with a preload of {q('fig5.wedge.preload')} (to "
        f"within {q('fig5.wedge.nearest')}). Its response differs by {q('fig5.wedge')} from "
        "the single screw with our preload, which the paper does not print. The gear ratio "
        "hides the wedge's mass, but not its friction.",
        ("fig5.wedge",),
    )


def _limit(q: Quoted) -> RootCause:
    return RootCause(
        f"Wedge and screw differ by {q('fig6.wedge.below_limit')} below the current limit, "
        f"and by {q('fig6.wedge')} where the limit begins. The response jumps there, and a "
        "small change in friction moves the jump.",
        ("fig6.wedge",),
    )


def _stiff_loop(q: Quoted) -> RootCause:
    return RootCause(
        "Friction affects the response of a stiff loop only at small amplitudes. With the "
        f"60 Hz controller it changes the response at 1 Hz by {q('fig6.friction')} of "
        "0.25 rad (our choice), and by a larger fraction of smaller amplitudes.",
        ("fig6.friction",),
    )
