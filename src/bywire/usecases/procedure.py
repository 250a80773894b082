"""Procedure: a sequence of stops under prescribed conditions, with limits."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bywire.usecases.asks import BenchChanges, ErrorEstimate
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.procedure import ProcedureResult
    from bywire.core.typing import Progress
    from bywire.procedures.procedure_file import ProcedurePlan

ProcedureName = Annotated[
    str | Path,
    Ask("Procedure file (TOML).", "Procedure", files=".toml", offered=("procedures",)),
]


def _read(procedure: str | Path, overrides: Mapping[str, str]) -> "ProcedurePlan":
    from bywire.procedures.procedure_file import read_procedure

    return read_procedure(procedure, overrides)


@use_case(
    Command("procedure", status_1="unless every limit is met"),
    form=Form("Procedure", "Run", "procedure"),
    check=_read,
)
def run_procedure(
    procedure: ProcedureName,
    overrides: BenchChanges = NOTHING,
    *,
    progress: "Progress | None" = None,
    estimate_error: ErrorEstimate = True,
) -> "ProcedureResult":
    """Run the stops of a procedure in order, and check their limits.

    Parameters
    ----------
    procedure
        Procedure file (see ``docs/procedures.md``).
    overrides
        Changes to all stops, as strings with units, in the same form as ``--set``. ``v_max`` and
        ``numbers.NAME`` change the maximum speed and a number of the procedure.
    progress
        Called with the name of a stop and the completed fraction, 0 to 1.
    estimate_error
        Whether to estimate the numerical error of key figures by rerunning stops that have limits
        with other steps. A limit is undecided if the difference between the key figure and the
        limit is smaller than this error.

    Returns
    -------
    ProcedureResult
        Each stop with its conditions, key figures in SI units, and verdicts on its limits.

    Raises
    ------
    InputError
        If the file is invalid, or an interval is shorter than a stop.
    RunError
        If a run fails, or no demand reaches a required deceleration.
    KeyboardInterrupt
        If interrupted.
    """
    from bywire.api.procedure import ProcedureResult
    from bywire.core.typing import silent
    from bywire.procedures.sequence import run_stops

    plan = _read(procedure, overrides)
    return ProcedureResult(run_stops(plan, progress or silent, estimate_error=estimate_error))
