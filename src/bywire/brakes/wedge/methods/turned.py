"""Runs of the rigs and the brake that begin at another angle of the shafts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from bywire.bench.experiment import Case
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import slope_of
from bywire.core.typing import Array

_ANGLES = ("theta_", "last_")


def turned(case: Case, angle: float) -> Case:
    """Return a rig's run that begins at another angle of the shafts, everything else alike.

    Encoder counts and cogging then fall elsewhere, as they do on a bench from day to day.

    ``case``: of a rig, or of the wedge brake, whose wedge moves along; ``angle``: added to every
    shaft's angle [rad].
    """

    def shifted(row: Any) -> Any:
        names = [n for n in row._fields if n.startswith(_ANGLES)]
        row = row._replace(**{n: getattr(row, n) + angle for n in names})
        if "x" in row._fields and isinstance(case.par, WedgeParameters):
            row = row._replace(x=row.x + slope_of(case.par) * angle)
        return row

    def stimulus(t: Array) -> dict[str, Array]:
        given = dict(case.stimulus(t))
        return given | {n: v + angle for n, v in given.items() if n.startswith(_ANGLES)}

    return replace(case, state=shifted(case.state), memory=shifted(case.memory), stimulus=stimulus)
