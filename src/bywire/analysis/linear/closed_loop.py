"""Exact linear models of sampled loops: controllers' ticks and continuous plant in one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.sampled_system import SampledSystem, sampled_models
from bywire.core.arguments import checked
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of


@checked
def closed_loop(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    locked: Sequence[str] = (),
    stimulus: NamedTuple | None = None,
    step: float = 0.0,
) -> LinearModel:
    r"""Return a model with its controllers, from one instant at which all of them run to the next.

    Between two instants at which any task runs,

    .. math:: m' = M_x x + M_m m + M_u u, \quad x' = A_d x + B_d m'

    with the Jacobians M of the ticks that are due, one after the other, and the exact A_d, B_d of
    the plant; dry friction is removed. Tasks of different periods are lifted to their common
    period, over which the input is held. Outputs are those of the instant, memory renewed.

    Parameters
    ----------
    model, par
        The system and its parameters. What jumps (a quantizer, a dither's
        waveform) has no slope: switch it off.
    state, memory
        Operating point.
    inputs
        Fields of Stimulus.
    outputs
        Fields of Output or State.
    locked
        States held at the operating point, for instance angle and speed of a locked rotor.
    stimulus
        Stimulus at the operating point, where a limit of the controller depends on it; zero by
        default.
    step
        Substep [s] of the simulation's midpoint rule, which then takes the place of the exact
        A_d, B_d; 0 for none.

    Raises
    ------
    ParameterError
        When the model has no task, or a contact just touches.
    CornerError
        As `bywire.analysis.linear.linearize.linearize`.
    UnknownNameError
        When a name is unknown.
    """
    return sampled_models(
        model,
        par,
        (state, memory, stimulus),
        lambda system: (closed_again(model, system, inputs),),
        inputs=inputs,
        outputs=outputs,
        locked=locked,
        step=step,
    )[0]


def closed_again(model: Model, system: SampledSystem, inputs: Sequence[str]) -> LinearModel:
    """Return `closed_loop` of a system that was made for the same inputs."""
    plant, fields = system.plant, model.Memory._fields
    size = len(plant.states) + len(fields)
    A, B = np.eye(size), np.zeros((size, len(inputs)))
    for f in range(system.common):
        F, G = system.step(system.in_a_row(system.due(f)))
        A, B = F @ A, F @ B + G
    M_x, M_m, M_u = system.in_a_row(system.due(0))
    C = np.hstack([plant.C + plant.D @ M_x, plant.D @ M_m])
    stimuli, held = signals_of(model.Stimulus), signals_of(model.Memory)
    return LinearModel(
        model.name,
        A,
        B,
        C,
        plant.D @ M_u,
        (*plant.states, *(f"{name}[k]" for name in fields)),
        tuple(inputs),
        plant.outputs,
        (*plant.state_units, *(held[name].unit for name in fields)),
        tuple(stimuli[name].unit for name in inputs),
        plant.output_units,
        np.zeros(size),
        system.common * system.frame,
    )
