"""Roberts, Schautt, Hartmann, Gombert (2003), reproduced: Figs. 5 to 9, rigs, statements."""

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

SOURCE = Source(
    name=MAIN,
    summary="self-reinforcing wedge brake with two motors, SAE 2003",
    reproduce=lambda progress: reproduced(
        Reproduction(
            MAIN, CITATION, allowances=tuple(ALLOWANCES.values()), sets={"": "Our parameter set"}
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
        "The paper's instability above mu_B = tan(alpha) neglects friction: without "
        f"it the brake runs away from {q('stability.runaway')} on "
        f"({q.stated('stability.runaway')} stated), but dry friction of bearings, "
        "screws and wedge holds it without power below "
        f"{q('stability.runaway.friction')} at 500 Nm and "
        f"{q('stability.runaway.friction.950')} at 950 Nm.",
        ("stability.runaway.friction",),
    )


def _pulse_length(q: Quoted) -> RootCause:
    return RootCause(
        "The length of Fig. 9's pulse is not printed: within our 0.2 s the filtered "
        f"power above standby already falls to {q('fig9.lowest_power')} times that of "
        "Fig. 7's hold, which the paper does not report; in a pulse that ends at 90 % of "
        f"the moment it is {q('fig9.lowest_power.short')} times.",
        ("fig9.lowest_power",),
    )


def _bearings(q: Quoted) -> RootCause:
    return RootCause(
        "Motor torque and force alone do not measure the screw's efficiency: with the "
        f"bearings' friction included, the rig reads {q('efficiency.raw')} of the true "
        f"{q.stated('efficiency.raw')}; with their torque without load subtracted, "
        f"{q('efficiency.recovered')}. The rest is the bearings' friction under load, "
        "which no sensor of the rig can separate from the screw's.",
        ("efficiency.*",),
    )


def _dead_band(q: Quoted) -> RootCause:
    return RootCause(
        "Position steps end where friction holds the shaft: with the soft low-bandwidth "
        f"controller a shaft can rest {q('position.dead_band.low')} from its "
        "reference, and the preload that remains with the wedge decides where. Its "
        f"response differs from that of the screws alone by {q('position.wedge.low')} "
        f"of the step, but only by {q('position.wedge.high')} with the other "
        f"controller, with which friction holds {q('position.dead_band.high')}.",
        ("position.wedge.*",),
    )


def _preload(q: Quoted) -> RootCause:
    return RootCause(
        "The low-bandwidth controller is too soft to keep the wedge's preload: its "
        f"response is that of a screw preloaded by {q('fig5.wedge.preload')} (to "
        f"{q('fig5.wedge.nearest')}), and {q('fig5.wedge')} away from that with our "
        "preload of the single screw, which the paper does not print. The gear ratio "
        "hides the wedge's mass, not its friction.",
        ("fig5.wedge",),
    )


def _limit(q: Quoted) -> RootCause:
    return RootCause(
        f"Wedge and screw differ by {q('fig6.wedge.below_limit')} as long as the "
        f"current limit is not reached, and by {q('fig6.wedge')} where the limit begins: "
        "there the response jumps, and a small change of friction moves the jump.",
        ("fig6.wedge",),
    )


def _stiff_loop(q: Quoted) -> RootCause:
    return RootCause(
        "Friction affects the response of a stiff loop only where the amplitude is "
        f"small: with 60 Hz it moves the response at 1 Hz by {q('fig6.friction')} of "
        "0.25 rad, our choice, and by more of a smaller amplitude.",
        ("fig6.friction",),
    )
