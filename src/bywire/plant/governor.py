"""Governor of a compressor: it cuts in below one pressure and cuts out above another.

The governor is a switch with memory. A model samples it in a task, so the compressor is loaded or
idle for at least a sample.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Pressure
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Mechanical pressure switch."""

    T_s: Duration
    """interval at which the model samples the switch"""
    p_in: Pressure
    """gauge pressure below which the compressor is loaded"""
    p_out: Pressure
    """gauge pressure above which the compressor is idle"""

    @model_validator(mode="after")
    def _has_hysteresis(self) -> Parameters:
        if not self.p_in < self.p_out:
            raise RuleError(
                "p_in",
                f"{self.p_in / 1e5:g} bar",
                f"< p_out = {self.p_out / 1e5:g} bar",
                "without hysteresis, the compressor would switch at every sample",
            )
        return self


FAULTS = (
    ParameterFault("idle", "unloader stuck open: the compressor is never loaded", ("p_in",), 1e-6),
)


class State(NamedTuple):
    """Whether the compressor is loaded."""

    on: Annotated[float, Signal("1", "compressor loaded")]


class Input(NamedTuple):
    """Gauge pressure of the tank."""

    p: Annotated[float, Signal("Pa", "pressure of the tank", 8e5)]


def output(x: State, u: Input, par: Parameters) -> State:
    """Return the switch after a sample. Between both pressures, it keeps its position."""
    return State(on=ops.where(u.p < par.p_in, 1.0, ops.where(u.p > par.p_out, 0.0, x.on)))
