"""The run of a bench that is exported, with all that its kernel is emitted from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.running import run_of
from bywire.core.errors import ParameterError, unknown_name
from bywire.simulation.emission import layout_of
from bywire.simulation.emit_single import EXPORTED, emit_single
from bywire.simulation.engine import prepare
from bywire.simulation.layout import Layout
from bywire.simulation.program import Program
from bywire.simulation.run import Run, initial_vector
from bywire.simulation.schedule import Schedule
from bywire.simulation.stages import Stages, build_stages


@dataclass(frozen=True, eq=False)
class Exported:
    """One run of a bench, for export.

    Parameters
    ----------
    bench
        Whose parameters, step and seed are exported.
    number, case
        Which of its runs.
    run
        The engine's description of it; its time begins with the settling.
    """

    bench: Bench
    number: int
    case: Case
    run: Run

    @cached_property
    def program(self) -> Program:
        """Its symbolic functions."""
        return prepare(self.run.model, self.run.par).program

    @cached_property
    def stages(self) -> Stages:
        """Its one expression graph."""
        return build_stages(self.program)

    @cached_property
    def kernel(self) -> str:
        """C source of its kernel: that of the bench's own run, without its pauses."""
        return emit_single(self.stages, EXPORTED)

    @property
    def layout(self) -> Layout:
        """Where what stands in the state vector."""
        return layout_of(self.stages)

    @cached_property
    def schedule(self) -> Schedule:
        """Its integer plan."""
        return self.run.schedule()

    @property
    def demanded(self) -> list[float]:
        """What drives the run at its start, without noise."""
        names = self.run.model.Stimulus._fields
        (row,) = self.run.stimulus(np.zeros(1))
        return [
            0.0 if name.startswith("noise_") else float(value)
            for name, value in zip(names, row, strict=True)
        ]

    @property
    def vector(self) -> list[float]:
        """State vector at the start."""
        started: list[float] = initial_vector(self.layout, self.run.state, self.run.memory).tolist()
        return started


def exported(bench: Bench, label: str = "") -> Exported:
    """Return the run of a bench that is exported.

    Parameters
    ----------
    label
        Which of its runs; may be left out where there is but one.

    Raises
    ------
    ParameterError
        When the bench makes no run, several without a choice, or one whose parameters change.
    UnknownNameError
        When it has no run of that label.
    """
    cases = bench.cases()
    labels = [case.label for case in cases]
    if not cases:
        raise ParameterError(
            f"experiment {bench.experiment!r} computes a characteristic without any run, and "
            "there is nothing to export: take another experiment, for instance 'open-loop'"
        )
    if label and label not in labels:
        raise unknown_name("run", label, labels)
    if not label and len(cases) > 1:
        raise ParameterError(
            f"the bench makes {len(cases)} runs, and one is exported: choose it, "
            f"case = {' or '.join(map(repr, labels))}"
        )
    number = labels.index(label) if label else 0
    run = run_of(bench, cases[number], number)
    if run.changes:
        raise ParameterError(
            "parameters of this bench change during the run, which cannot be exported: leave out "
            "its [[faults]], or export it with the changed parameters"
        )
    return Exported(bench, number, cases[number], run)
