"""Projection of a brake's wear over thousands of stops, and of its end of life."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchChanges
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.life import LifeResult
    from bywire.core.typing import Progress
    from bywire.life.life_file import LifePlan

LifeName = Annotated[
    str | Path,
    Ask(
        "Life file (TOML) or a life's name (see 'bywire list lives').",
        "Life",
        name="life",
        known=("lives",),
        files=".toml",
        offered=("lives",),
    ),
]
CheckedStops = Annotated[
    int,
    Ask(
        "Number of stops to simulate individually as a check.",
        "Stops to simulate individually",
        least=0,
    ),
]


def _read(source: str | Path, overrides: Mapping[str, str], check: int) -> "LifePlan":
    from bywire.api.life import require_checkable
    from bywire.life.life_file import read_life

    plan = read_life(source, overrides)
    require_checkable(check, plan)
    return plan


@use_case("life", form=Form("Life", "Project", "life"), check=_read)
def project_life(
    source: LifeName,
    overrides: BenchChanges = NOTHING,
    *,
    check: CheckedStops = 0,
    progress: "Progress | None" = None,
) -> "LifeResult":
    """Project a brake's wear over thousands of stops until its end of life.

    Parameters
    ----------
    source
        Life file (see ``docs/life.md``), or the name of a life.
    overrides
        Changes to the bench, wear (``wear.NAME``) and stop conditions (``stop.NAME``), as strings
        with units.
    check
        Number of stops to also simulate individually to check the projection. bywire rounds it down
        to whole rounds of the population. Default: none.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    LifeResult
        Number of stops until end of life, with an interval, and the slow states after each stop
        [SI].

    Raises
    ------
    InputError
        If the life file is invalid, or the brake is already at its end of life at the start.
    RunError
        If a run fails, or a stop lacks a key figure on which wear depends.
    KeyboardInterrupt
        If interrupted.
    """
    from bywire.api.life import LifeResult
    from bywire.core.typing import silent
    from bywire.life.projection import one_by_one, projected

    shown = progress or silent
    plan = _read(source, overrides, check).with_step(progress)
    made = projected(plan, shown)
    rounds = min(check, made.stops) // plan.count
    return LifeResult(made, one_by_one(plan, rounds * plan.count, shown) if rounds else {})
