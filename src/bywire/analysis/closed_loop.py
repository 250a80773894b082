"""Exact linear models of sampled loops: controller tick and continuous plant in one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from bywire.analysis.linear_model import LinearModel
from bywire.analysis.linearize import linearize
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of, zeros


def closed_loop(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    locked: Sequence[str] = (),
) -> LinearModel:
    r"""Return a model with its controller, from one sampling instant to the next.

    .. math:: m_{k+1} = M_x x_k + M_m m_k + M_u u_k, \quad x_{k+1} = A_d x_k + B_d m_{k+1}

    with the Jacobians M of the controller's tick and the exact A_d, B_d of the plant between the
    instants; dry friction is removed. Outputs are those of the instant, memory renewed.

    Parameters
    ----------
    model, par
        The system, with one task, and its parameters. What jumps (a quantizer, a dither's
        waveform) has no slope: switch it off.
    state, memory
        Operating point.
    inputs
        Fields of Stimulus.
    outputs
        Fields of Output or State.
    locked
        States held at the operating point, for instance angle and speed of a locked rotor.

    Raises
    ------
    ParameterError
        When the model has several tasks.
    UnknownNameError
        When a name is unknown.
    """
    tasks = model.tasks(par)
    if len(tasks) != 1:
        raise ParameterError(f"{model.name} has {len(tasks)} tasks: closed_loop takes one")
    for name in inputs:
        if name not in model.Stimulus._fields:
            raise unknown_name("signal of the stimulus", name, model.Stimulus._fields)
    fields = model.Memory._fields
    plant = linearize(model, par, state, memory, inputs=fields, outputs=outputs)
    kept = [name for name in plant.states if name not in locked]
    plant = plant.reduced(kept, held=bool(locked)).sampled(tasks[0].period)
    M_x, M_m, M_u = _tick(model, par, state, memory, inputs, kept)
    A = np.block([[plant.A + plant.B @ M_x, plant.B @ M_m], [M_x, M_m]])
    C = np.hstack([plant.C + plant.D @ M_x, plant.D @ M_m])
    stimuli, held = signals_of(model.Stimulus), signals_of(model.Memory)
    return LinearModel(
        model.name, A, np.vstack([plant.B @ M_u, M_u]), C, plant.D @ M_u,
        (*plant.states, *(f"{name}[k]" for name in fields)), tuple(inputs), plant.outputs,
        (*plant.state_units, *(held[name].unit for name in fields)),
        tuple(stimuli[name].unit for name in inputs), plant.output_units,
        np.zeros(A.shape[0]), plant.period,
    )  # fmt: skip


def _tick(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    inputs: Sequence[str],
    kept: Sequence[str],
) -> list[Any]:
    """Return the Jacobians of the new memory by kept states, memory and inputs."""
    import casadi as ca

    sizes = {"x": len(kept), "m": len(memory), "u": len(inputs)}
    x, m, u = (ca.SX.sym(name, size) for name, size in sizes.items())
    at = state._replace(**dict(zip(kept, ca.vertsplit(x), strict=True)))
    stimulus: Any = zeros(cast(Any, model.Stimulus))
    stimulus = stimulus._replace(**dict(zip(inputs, ca.vertsplit(u), strict=True)))
    held = cast(Any, model.Memory)(*ca.vertsplit(m))
    renewed = ca.vertcat(*model.tasks(par)[0].tick(at, held, stimulus, par))
    jacobians = ca.Function("tick", [x, m, u], [ca.jacobian(renewed, v) for v in (x, m, u)])
    values = jacobians([getattr(state, n) for n in kept], list(memory), np.zeros(len(inputs)))
    return [np.array(value, dtype=float) for value in values]
