"""Stribeck curve: dry friction of a model over speed, at several values of another state.

Nothing runs: the bounds of the friction are evaluated where the model rests, with contacts pressed
as its overlaps say.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import xarray as xr
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

Speed = Annotated[float, Unit("friction"), Field(gt=0, allow_inf_nan=False)]
Levels = Annotated[
    tuple[Annotated[float, Field(allow_inf_nan=False)], ...], Unit("along"), Field(min_length=1)
]

_FORCES = {"rad/s": "N*m", "m/s": "N", "m**3/s": "Pa"}
"""what acts against a velocity: its product with it is a power"""
_SIDE = 401  # speeds in each direction
_SWEEPS, _SETTLED = 500, 1e-12  # of the contact forces; their change, of the largest


class Options(ParameterSet):
    """Where the curves are drawn."""

    friction: str
    """velocity with dry friction; the model's first one unless given"""
    along: str
    """state that the friction depends on, one curve for each level; the velocity: one curve"""
    levels: Levels
    """levels of that state"""
    speed_max: Speed
    """largest speed, both directions"""


def build(subject: TestedModel) -> Experiment:
    """Return the experiment of a model."""
    velocity, along = subject.names["friction"], subject.names["along"]
    force = _FORCES.get(subject.units["friction"], f"W/({subject.units['friction']})")

    figures = Figures(
        breakaway_forward=(
            force,
            "Largest friction from rest toward positive speeds, over the levels.",
        ),
        breakaway_backward=(
            force,
            "Largest friction from rest toward negative speeds, over the levels.",
        ),
        least_friction=(force, "Smallest friction in either direction, over speeds and levels."),
    )

    def static(par: Any, options: Any) -> dict[str, xr.Dataset]:
        """Return friction over level and speed; at rest the breakaway force of each side."""
        side = np.linspace(0.0, options.speed_max, _SIDE)
        speeds = np.concatenate((-side[::-1], side))
        values = np.array(
            [_curve(subject.model, par, velocity, along, level, side) for level in options.levels]
        )
        states = signals_of(subject.model.State)
        dims = (f"{along}_level" if along == velocity else along, velocity)
        labels = (states[along].label, states[velocity].label)
        axes = (np.array(options.levels), speeds)
        coords = {
            dim: (dim, axis, {"units": states[name].unit, "long_name": label})
            for dim, name, axis, label in zip(dims, (along, velocity), axes, labels, strict=True)
        }
        curve = xr.Dataset(
            {"friction": (dims, values, {"units": force, "long_name": "dry friction"})}, coords
        )
        return {"curve": curve}

    def judge(recordings: Recordings, options: Any) -> tuple[Kpi, ...]:
        """Return the friction from rest in both directions, and the smallest one in motion."""
        friction = recordings["curve"]["friction"].values
        forward, backward = friction[:, _SIDE:], -friction[:, _SIDE - 1 :: -1]
        return figures(
            breakaway_forward=forward[:, 0].max(),
            breakaway_backward=backward[:, 0].max(),
            least_friction=min(forward.min(), backward.min()),
        )

    return Experiment(
        name=GENERIC.name,
        assembly=subject.model.name,
        summary=GENERIC.summary,
        options=subject.options,
        defaults=subject.defaults,
        cases=lambda *_: (),
        judge=judge,
        kpis=figures.units,
        figures=("stribeck-curve",),
        static=static,
    )


def _curve(model: Model, par: Any, velocity: str, along: str, level: float, side: Array) -> Array:
    """Return the friction at speeds of both signs: -0 and +0 are both ends of the rest."""
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

    Per group the forces F >= 0 with ``C F - d >= 0`` and ``F (C F - d) = 0``, by projected
    Gauss-Seidel sweeps, which converge as C is positive definite.

    Raises
    ------
    ParameterError
        When they do not settle.
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
            raise ParameterError(f"{model.name}: the contacts do not settle at this state")
        forces += F.tolist()
    return tuple(forces)


GENERIC = GenericExperiment(
    name="stribeck",
    summary="dry friction of a model over speed, at levels of a state that it depends on",
    options=Options,
    signals={"friction": "friction", "along": "state"},
    defaults={"levels": (0.0,), "speed_max": 1.0},
    build=build,
)
