"""Shared parts of the wedge brake's experiments: starts, readings, key figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from bywire.bench.experiment import Case
from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.wedge.laws.moment_control import PARKED
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.errors import not_valid
from bywire.core.quantities import Unit
from bywire.core.signals import zeros
from bywire.core.typing import Array
from bywire.plant import roller_screw

if TYPE_CHECKING:
    import xarray as xr

Signals = Mapping[str, Array]


def case_from_parked(
    par: WedgeParameters,
    stimulus: Callable[[Array], Signals],
    duration: float,
    changes: Mapping[str, Any] | None = None,
    label: str = "run",
    **timing: float,
) -> Case:
    """Return an experiment's run that starts parked, preloaded, without current.

    Parameters
    ----------
    changes
        Parameters that the experiment sets. Default command mode: "moment".
    timing
        ``settle``, ``keep`` and ``record`` of the case [s].
    """
    changed = par.replace({"command.mode": "moment", **(changes or {})})
    return Case(
        label=label,
        model=WedgeBrake(),
        par=changed,
        state=state_at(0.0, changed),
        memory=memory_at(0.0, changed),
        stimulus=stimulus,
        duration=duration,
        start=lambda par: (state_at(0.0, par), memory_at(0.0, par)),
        **timing,
    )


def steps(t: Array, levels: Mapping[float, float]) -> Array:
    """Return a signal with each level from its time [s] on, and zero before the first level."""
    y = np.zeros(t.shape)
    for begin, level in sorted(levels.items()):
        y = np.where(t >= begin - 1e-9, level, y)
    return y


def parameters_of(run: xr.Dataset) -> WedgeParameters:
    """Return the parameters of a recording."""
    par = getattr(run, "par", None)  # an attribute of plain rows
    if isinstance(par, WedgeParameters):
        return par
    return WedgeParameters.model_validate_json(run.attrs["parameters"])


def release_time(run: xr.Dataset, begin: float, name: str = "release_time") -> Kpi:
    """Return the time from the end of the demand [s] until the pads finally leave the disc."""
    after = run.sel(time=slice(begin - 1e-9, None))
    pressing = np.flatnonzero(after["F_N"].values > 0)
    value, note = math.nan, ""
    if not after.sizes["time"]:
        note = "the recording has no row after the end of the demand"
    elif not pressing.size:
        note = "the pads are not applied when the demand falls"
    elif pressing[-1] + 1 == after.sizes["time"]:
        note = "the pads stay applied until the end of the recording"
    else:
        value = float(after["time"].values[pressing[-1]]) - begin
    text = "Time from the end of the demand until the pads leave the disc."
    return Kpi(name, value, "s", text, note)


def parking_time(run: xr.Dataset, begin: float, name: str = "parking_time") -> Kpi:
    """Return the time from the end of the demand [s] until the brake is parked."""
    after = run.sel(time=slice(begin - 1e-9, None))
    parked = np.flatnonzero(after["mode"].values == PARKED)
    value, note = math.nan, "the brake is not parked at the end of the recording"
    if parked.size:
        value, note = float(after["time"].values[parked[0]]) - begin, ""
    return Kpi(name, value, "s", "Time from the end of the demand until the brake is parked.", note)


def first(run: xr.Dataset, name: str, level: float) -> float:
    """Return the time [s] at which a signal first exceeds a level, interpolated, or NaN."""
    t, y = run["time"].values, run[name].values
    above = np.flatnonzero(y > level)
    if above.size == 0:
        return math.nan
    k = int(above[0])
    if k == 0 or level == 0.0:
        return float(t[k])
    return float(t[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (t[k] - t[k - 1]))


def mean(run: xr.Dataset, name: str, begin: float, end: float) -> float:
    """Return the mean of a signal between two times [s], NaN without a row in between."""
    values = run[name].sel(time=slice(begin - 1e-9, end + 1e-9)).values
    return float(values.mean()) if values.size else math.nan


def swing(run: xr.Dataset, name: str, begin: float, end: float) -> float:
    """Return the peak-to-peak value of a signal between two times [s], NaN without a row."""
    values = run[name].sel(time=slice(begin - 1e-9, end + 1e-9)).values
    return float(np.ptp(values)) if values.size else math.nan


# --- Reading recordings: direction of the disc


def along_disc(run: xr.Dataset) -> xr.Dataset:
    """Return a recording with moments and speed positive in the disc's initial direction."""
    if not float(run["Omega"].values[0]) < 0:
        return run
    # Subtract instead of negating, which would give negative zeros.
    return run.assign({name: 0.0 - run[name] for name in ("M_B", "y_M", "Omega")})


# --- Several friction coefficients

FRICTIONLESS = {
    "bearing.C_0": 0.0,
    "bearing.C_1": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.law": "load",
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
    "encoder.law": "ideal",
}
"""overrides that remove all dry friction except between pads and disc. The encoder is ideal,
because without friction its counts would keep the shafts moving"""


def distinct(
    name: Callable[[float], str], unit: str = ""
) -> Callable[[tuple[float, ...]], tuple[float, ...]]:
    """Return a validator that requires a different label for each value."""

    def check(values: tuple[float, ...]) -> tuple[float, ...]:
        names = [name(value) for value in values]
        for k, value in enumerate(values):
            if names[k] in names[:k]:
                raise ValueError(f"{value:g}{unit} is listed twice. Remove one of them")
        return values

    return check


def tag(mu_B: float) -> str:
    """Return the name of a friction coefficient in labels and key figures.

    Examples
    --------
    >>> tag(0.35), tag(0.355)
    ('mu35', 'mu35p5')
    """
    return f"mu{100.0 * mu_B:.10g}".replace(".", "p")


Coefficients = Annotated[
    tuple[Annotated[float, Field(gt=0, le=2, allow_inf_nan=False)], ...],
    Unit("1", 0.35),
    Field(min_length=1, max_length=100),
    AfterValidator(distinct(tag)),
]
"""pad friction coefficients, in any order, without repetition"""


def with_friction(par: WedgeParameters, mu_B: float, known: bool) -> dict[str, Any]:
    """Return the overrides that set the pad friction coefficient.

    Parameters
    ----------
    known
        Whether the moment controller uses the slope that corresponds to the coefficient. This slope
        keeps its ratio to the brake's slope, so an existing mismatch remains.
    """
    slope = par.control.moment.slope_hat
    if known and par.wedge.mu_B > 0:
        slope *= mu_B / par.wedge.mu_B
    return {"wedge.mu_B": mu_B, "control.moment.slope_hat": slope}


# --- On the rigs of the drive train

Stimuli = Callable[[Array], Mapping[str, Array]]


def shaft_case(
    label: str,
    par: WedgeParameters,
    stimulus: Stimuli,
    duration: float,
    changes: Mapping[str, Any],
    **timing: float,
) -> Case:
    """Return a run of the rig with one motor, from rest at angle zero.

    ``changes``: parameters that the experiment sets, including the rig's modes; ``timing``:
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
    """Return a run of the rig with two motors, from rest without force (see `shaft_case`)."""
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
    """Require a current that the drives can supply.

    ``name``: option with the current; ``i``: its value [A].

    Raises
    ------
    ParameterError
        If the current exceeds the drives' limit.
    """
    limit = par.drive.i_max
    if i > limit:
        valid, advice = f"<= {limit:g} A", "the maximum current of the drives (drive.i_max)"
        raise not_valid(f"options.{name}", f"{i:g} A", valid, advice)


def slope_of(par: WedgeParameters) -> float:
    """Return the screw's travel per angle [m/rad]."""
    return roller_screw.slope(par.screw)


def torque_constant_of(par: WedgeParameters) -> float:
    """Return the torque constant [N m/A] assumed by the rig's control."""
    return par.control.position.K_hat


def peak(run: xr.Dataset, name: str) -> float:
    """Return the maximum magnitude of a signal after t = 0."""
    return float(np.abs(run[name].sel(time=slice(-1e-9, None)).values).max())


# --- Runs of the rigs and the brake from other shaft angles

_ANGLES = ("theta_", "last_")


def turned(case: Case, angle: float) -> Case:
    """Return an equal run that starts from other shaft angles.

    Encoder counts and cogging then have other phases, as on a real bench from day to day.

    ``case``: run of a rig, or of the wedge brake, whose wedge moves with the shafts; ``angle``:
    angle to add to each shaft [rad].
    """

    def shifted(row: Any) -> Any:
        names = [n for n in row._fields if n.startswith(_ANGLES)]
        row = row._replace(**{n: getattr(row, n) + angle for n in names})
        if "x" in row._fields and isinstance(case.par, WedgeParameters):
            row = row._replace(x=row.x + slope_of(case.par) * angle)
        return row

    def stimulus(t: Array) -> dict[str, Array]:
        demands = dict(case.stimulus(t))
        return demands | {n: v + angle for n, v in demands.items() if n.startswith(_ANGLES)}

    return replace(case, state=shifted(case.state), memory=shifted(case.memory), stimulus=stimulus)
