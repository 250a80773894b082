"""Steps, seeds and sizes that a run can have, checked before anything is computed."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

from bywire.bench.experiment import Case
from bywire.core import units
from bywire.core.errors import ParameterError, StepError, quoted
from bywire.core.machine import machine_memory as _memory
from bywire.simulation.run import Run

SHORTEST_STEP = 1e-9
"""substep [s] below which a single tick of an ECU would take seconds"""
LARGEST_SEED = 2**63 - 1
"""largest seed that a recording's file can hold"""

_COPIES = 3  # of the recorded rows, while they become a dataset and a file
_GIGA = 1e9


def checked_step(value: Any) -> float:
    """Return a substep [s], or raise a StepError."""
    step = units.parse(value, "s", "simulation.step")
    if step < SHORTEST_STEP:
        raise StepError(
            f"simulation.step = {step:g} s is not valid: "
            f"it must be >= {SHORTEST_STEP:g} s, usually 20 us"
        )
    return step


def checked_interval(value: Any) -> float | None:
    """Return a recording interval [s], None for the experiment's own, or raise a StepError."""
    if value is None:
        return None
    interval = units.parse(value, "s", "simulation.record")
    if interval <= 0:
        raise StepError(
            f"simulation.record = {interval:g} s is not valid: it must be > 0 s, usually 1 ms"
        )
    return interval


def check_seed(value: Any) -> None:
    """Raise a ParameterError unless the value is a seed."""
    whole = isinstance(value, int) and not isinstance(value, bool)
    if not whole or not 0 <= value <= LARGEST_SEED:
        raise ParameterError(
            f"simulation.seed = {quoted(value)} is not valid: "
            f"it must be a whole number, >= 0 and <= {LARGEST_SEED}"
        )


def check_extent(case: Case, run: Run) -> None:
    """Refuse a run that records nothing, or more than the memory of this machine holds.

    ``case``: the run as the experiment describes it; ``run``: the same as the engine takes it.

    Raises
    ------
    StepError
        When steps do not divide each other, or with the memory that the run would need.
    """
    if not run.record <= case.duration:
        raise StepError(
            f"a recording of {case.duration:g} s cannot have rows every {run.record:g} s: "
            "run longer, or record more often (simulation.record)"
        )
    check_memory(run, len(run.model.Output._fields))


def check_memory(run: Run, signals: int) -> None:
    """Refuse a run whose rows do not fit into this machine.

    ``signals``: how many signals are recorded.

    Raises
    ------
    StepError
        When steps do not divide each other, or with the memory that the run would need.
    """
    schedule = run.schedule()
    numbers = schedule.rows * signals * _COPIES
    numbers += schedule.stimulus_rows * len(run.model.Stimulus._fields)
    needed, memory = 8 * numbers, _memory()  # a float does not hold all that one may ask for
    if needed > memory:
        raise StepError(
            f"a run of {run.duration:g} s, recorded every {run.record:g} s, needs about "
            f"{Decimal(needed) / 10**9:.3g} GB of memory, but this machine has "
            f"{memory / _GIGA:.3g} GB: run shorter, or record less often (simulation.record)"
        )
