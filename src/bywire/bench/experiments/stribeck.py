"""Stribeck curve: dry friction of a model versus speed, at several values of another state.

The experiment simulates nothing. It evaluates the friction's bounds with the model at rest, with
contact forces from its overlaps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Experiment, Recordings
from bywire.bench.generic_experiment import GenericExperiment, TestedModel, at_rest
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.core.errors import ParameterError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.data.labeled import labeled

if TYPE_CHECKING:
    import xarray as xr

Speed = Annotated[float, Unit("friction"), Field(gt=0, allow_inf_nan=False)]
Levels = Annotated[
    tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Unit("along"), Field(min_length=1)
]

_FORCES = {"rad/s": "N*m", "m/s": "N", "m**3/s": "Pa"}
"""unit of the force that opposes a velocity: their product is a power"""
_SIDE = 401  # number of speeds in each direction
_SWEEPS, _SETTLED = 500, 1e-12  # maximum number of sweeps; relative change of settled forces


class Options(ParameterSet):
    """Speeds and levels of the curves."""

    friction: str
    """velocity with dry friction (default: the model's first)"""
    along: str
    """state that affects the friction, with one curve per level; the velocity itself for a single
    curve"""
    levels: Levels
    """levels of that state"""
    speed_max: Speed
    """maximum speed in both directions"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model."""
    velocity, along = tested.names["friction"], tested.names["along"]
    force = _FORCES.get(tested.units["friction"], f"W/({tested.units['friction']})")

    figures = Figures(
        breakaway_forward=(
            force,
            "Maximum breakaway friction toward positive speeds, over all levels.",
        ),
        breakaway_backward=(
            force,
            "Maximum breakaway friction toward negative speeds, over all levels.",
        ),
        least_friction=(
            force,
            "Minimum friction in either direction, over all speeds and levels.",
        ),
    )

    def static(par: Any, options: Any) -> dict[str, xr.Dataset]:
        """Return friction by level and speed; at rest the breakaway force in each direction."""
        side = np.linspace(0.0, options.speed_max, _SIDE)
        speeds = np.concatenate((-side[::-1], side))
        values = np.array(
            [_curve(tested.model, par, velocity, along, level, side) for level in options.levels]
        )
        states = signals_of(tested.model.State)
        dims = (f"{along}_level" if along == velocity else along, velocity)
        labels = (states[along].label, states[velocity].label)
        axes = (np.array(options.levels), speeds)
        places = {
            dim: (axis, states[name].unit, label)
            for dim, name, axis, label in zip(dims, (along, velocity), axes, labels, strict=True)
        }
        return {"curve": labeled(places, {"friction": (values, force, "dry friction")})}

    def judge(recordings: Recordings, options: Any) -> tuple[Kpi, ...]:
        """Return the breakaway friction in both directions, and the minimum friction in motion."""
        friction = recordings["curve"]["friction"].values
        forward, backward = friction[:, _SIDE:], -friction[:, _SIDE - 1 :: -1]
        return figures(
            breakaway_forward=forward[:, 0].max(),
            breakaway_backward=backward[:, 0].max(),
            least_friction=min(forward.min(), backward.min()),
        )

    return Experiment(
        name=GENERIC.name,
        assembly=tested.model.name,
        summary=GENERIC.summary,
        options=tested.options,
        defaults=tested.defaults,
        cases=lambda *_: (),
        judge=judge,
        kpis=figures.units,
        figures=("stribeck-curve",),
        static=static,
    )


def _curve(model: Model, par: Any, velocity: str, along: str, level: float, side: Array) -> Array:
    """Return the friction at speeds of both signs; -0 and +0 give both breakaway forces."""
    rest, memory = at_rest(model, par)
    place = model.frictions.index(velocity)

    def friction(speed: float, forward: bool) -> float:
        x = rest._replace(**{along: level} | {velocity: speed})
        low, high = model.bounds(x, x, memory, par, contact_forces(model, x, par))[place]
        return -float(low) if forward else -float(high)

    return np.array(
        [friction(-float(v), False) for v in side[::-1]] + [friction(float(v), True) for v in side]
    )


def contact_forces(model: Model, x: Any, par: Any) -> tuple[float, ...]:
    """Return the contact forces of a state that does not move.

    The forces F >= 0 of each group satisfy ``C F - d >= 0`` and ``F (C F - d) = 0``. Projected
    Gauss-Seidel sweeps converge because C is positive definite.

    Raises
    ------
    ParameterError
        When the forces do not converge.
    """
    forces: list[float] = []
    for matrix, overlaps in zip(model.compliance(par), model.gap(x, x, par), strict=True):
        C, d = np.array(matrix, dtype=float), np.array(overlaps, dtype=float)
        F = np.zeros(d.size)
        for _ in range(_SWEEPS):
            before = F.copy()
            for k in range(d.size):
                F[k] = max(0.0, F[k] + (d[k] - C[k] @ F) / C[k, k])
            if np.max(np.abs(F - before), initial=0.0) <= _SETTLED * np.max(F, initial=0.0):
                break
        else:
            raise ParameterError(
                f"{model.name}: the contact forces do not converge in this state. Choose other "
                "levels or another friction law",
                name=model.name,
            )
        forces += F.tolist()
    return tuple(forces)


GENERIC = GenericExperiment(
    name="stribeck",
    summary="dry friction of a model versus speed, at several levels of a state that affects it",
    options=Options,
    signals={"friction": "friction", "along": "state"},
    defaults={"levels": (0.0,), "speed_max": 1.0},
    build=build,
)
