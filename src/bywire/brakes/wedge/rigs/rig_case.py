"""Shared parts of the rigs' experiments: runs from rest, data sheets, readings of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.errors import not_valid
from bywire.core.signals import zeros
from bywire.core.typing import Array
from bywire.plant import roller_screw

Stimuli = Callable[[Array], Mapping[str, Array]]


def shaft_case(
    label: str,
    par: WedgeParameters,
    stimulus: Stimuli,
    duration: float,
    changes: Mapping[str, Any],
    **timing: float,
) -> Case:
    """Return a run of the single motor's rig, from rest at the angle zero.

    ``changes``: parameters that the experiment sets, the rig's modes among them; ``timing``:
    ``settle``, ``keep`` and ``record`` of the case [s].
    """
    return _case(label, ShaftRig(), par.replace(changes), stimulus, duration, timing)


def screw_case(
    label: str,
    par: WedgeParameters,
    stimulus: Stimuli,
    duration: float,
    changes: Mapping[str, Any],
    **timing: float,
) -> Case:
    """Return a run of the two motors' rig, from rest without force; see :func:`shaft_case`."""
    return _case(label, ScrewRig(), par.replace(changes), stimulus, duration, timing)


def _case(
    label: str,
    model: ShaftRig | ScrewRig,
    par: WedgeParameters,
    stimulus: Stimuli,
    duration: float,
    timing: Mapping[str, float],
) -> Case:
    state, memory = zeros(model.State), zeros(model.Memory)
    return Case(
        label,
        model,
        par,
        state,
        memory,
        stimulus,
        duration,
        start=lambda _: (state, memory),
        **timing,
    )


def check_current(name: str, i: float, par: WedgeParameters) -> None:
    """Require a current that the drives can give.

    ``name``: option with the current; ``i``: its value [A].

    Raises
    ------
    ParameterError
        When it is above the drives' limit.
    """
    limit = par.drive.i_max
    if i > limit:
        valid, advice = f"<= {limit:g} A", "the largest current of the drives (drive.i_max)"
        raise not_valid(f"options.{name}", f"{i:g} A", valid, advice)


def slope_of(par: WedgeParameters) -> float:
    """Return the travel per angle [m/rad] by the screw's lead."""
    return roller_screw.slope(par.screw)


def torque_constant_of(par: WedgeParameters) -> float:
    """Return the torque constant [N m/A] assumed by the rig's control."""
    return par.control.position.K_hat


def peak(run: xr.Dataset, name: str) -> float:
    """Return the largest magnitude of a signal after t = 0."""
    return float(np.abs(run[name].sel(time=slice(-1e-9, None)).values).max())


# --- Runs of the rigs and the brake from another angle of the shafts

_ANGLES = ("theta_", "last_")


def turned(case: Case, angle: float) -> Case:
    """Return a rig's run from another angle of the shafts that is otherwise equal.

    Encoder counts and cogging then have other phases, as on a bench from day to day.

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
