"""``bywire linearize``: of a closed loop, or of a plant."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from bywire.analysis.linear.plant import PLANTS
from bywire.analysis.loop import LOOPS
from bywire.cli import linearize_command, plant_command, plant_locus
from bywire.core.errors import ParameterError, unknown_name


def execute(
    name: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    locus: str,
    reduce: str,
    friction: str,
    speed: str,
    dither: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the exact linear model of what has the name."""
    if name in PLANTS.all():
        if dither:
            raise ParameterError("--dither is for loops: leave it out, or name a loop")
        if locus:
            if reduce:
                raise ParameterError("--reduce and --locus exclude each other: ask for one of them")
            plant_locus.execute(
                name, parameters, at, changes, (friction, speed), locus, out, as_json
            )  # fmt: skip
            return
        plant_command.execute(
            name, parameters, at, changes, friction, speed, reduce, out, as_json
        )  # fmt: skip
        return
    if name not in LOOPS.all():
        raise unknown_name("loop or plant", name, (*LOOPS.all(), *PLANTS.all()))
    for option, given in (("--friction", friction), ("--speed", speed)):
        if given:
            raise ParameterError(
                f"{option} is for plants ({', '.join(PLANTS.all())}): controllers are linearized "
                "without dry friction; leave it out"
            )
    linearize_command.execute(name, parameters, at, changes, locus, reduce, dither, out, as_json)
