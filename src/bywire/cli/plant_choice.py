"""A plant with the parameters and the operating point that a user asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from bywire.analysis.linear.linearize import Friction
from bywire.analysis.linear.plant import PLANTS, Plant, PlantPoint
from bywire.analysis.loop import Quantity
from bywire.api.parameter_choice import parameters_for
from bywire.bench.values import number
from bywire.core.errors import ParameterError, UnitError, unknown_name
from bywire.core.parameters import ParameterSet

if TYPE_CHECKING:
    from bywire.report.subject import Subject


@dataclass(frozen=True)
class ChosenPlant:
    """A plant, its parameters by name and value, and where it is linearized."""

    plant: Plant
    name: str
    par: ParameterSet
    point: PlantPoint


def choose(
    name: str, parameters: str, at: str, changes: Mapping[str, str], friction: str, speed: str
) -> ChosenPlant:
    """Return what the command line asks for.

    Parameters
    ----------
    name
        Plant.
    parameters
        Parameter set; empty for the main one of the plant's brake.
    at
        Operating point; its unit says what it is. Empty for the plant's own.
    changes
        Parameters by dotted name, with units.
    friction, speed
        What dry friction does, and how fast the motors turn; empty: removed, at rest.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and sets of another brake.
    """
    plant = PLANTS.find(name)
    own, par = parameters_for(f"plant {plant.name!r}", plant.assembly, parameters, changes)
    quantity, value = _operating_point(plant, at)
    kind, omega = _friction(friction, speed)
    return ChosenPlant(plant, own, par, PlantPoint(quantity, value, kind, omega))


def point_text(point: PlantPoint) -> str:
    """Return an operating point and what friction does there."""
    from bywire.report.wording import amount

    moving = f" at {point.speed:g} rad/s" if point.speed else ""
    value = amount(point.value, point.quantity.unit)
    return f"{point.quantity.name} = {value}, friction {point.friction}{moving}"


def subject(chosen: ChosenPlant) -> Subject:
    """Return what a report says of a plant and its operating point."""
    from bywire.report.subject import Subject

    plant = chosen.plant
    return Subject(
        plant.name, plant.summary, chosen.name, chosen.par, point_text(chosen.point)
    )  # fmt: skip


def _operating_point(plant: Plant, at: str) -> tuple[Quantity, float]:
    if not at:
        return plant.at[0], plant.at[0].default
    for quantity in plant.at:
        try:
            return quantity, number(at, quantity.unit, quantity.name)
        except UnitError:
            continue
    known = ", ".join(f"{one.name} in {one.unit}" for one in plant.at)
    raise UnitError(f"--at {at!r}: {plant.name} takes one of {known}")


def _friction(friction: str, speed: str) -> tuple[Friction, float]:
    kinds: tuple[Friction, ...] = get_args(Friction)
    kind = next((one for one in kinds if one == (friction or "removed")), None)
    if kind is None:
        raise unknown_name("kind of friction", friction, kinds)
    omega = number(speed, "rad/s", "--speed") if speed else 0.0
    if kind == "sliding" and omega == 0.0:
        raise ParameterError(
            "--friction sliding: friction at rest has no slope; give the motors' speed with "
            "--speed, for instance '5 rad/s', positive toward clamping"
        )
    if kind != "sliding" and omega != 0.0:
        raise ParameterError(
            f"--speed {speed}: only sliding friction depends on it: add --friction sliding, or "
            "leave it out"
        )
    return kind, omega
