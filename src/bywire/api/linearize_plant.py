"""The exact linear model of a plant, sources in place of its controllers, or its poles by range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, get_args

from bywire.analysis.linear.corners import read_sides
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import Friction
from bywire.analysis.locus import Locus, locus_of
from bywire.analysis.loop import PLANTS, Plant, PlantPoint, Quantity
from bywire.analysis.reduction import Reduced, ReductionError, reduction_error
from bywire.api import linear_texts as texts
from bywire.api.loop_case import range_of
from bywire.api.parameter_choice import parameters_for
from bywire.core.callers import option
from bywire.core.errors import ParameterError, UnitError, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.values import number
from bywire.report.answer import Answer
from bywire.report.document import Block, Document, FigureBlock, Flat, Listing, Paragraph, Section
from bywire.report.subject import Subject
from bywire.report.wording import amount

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MADE = "Exact linear model of the plant, sources in place of its controllers."


@dataclass(frozen=True)
class PlantCase:
    """A plant with the parameters and the operating point that a user asked for.

    Parameters
    ----------
    plant
        The plant.
    name, par
        Name of the parameter set, and the values in use.
    point
        Where it is linearized, and what friction does there.
    """

    plant: Plant
    name: str
    par: ParameterSet
    point: PlantPoint

    @property
    def point_text(self) -> str:
        """The operating point and what friction does there."""
        point = self.point
        moving = f" at {point.speed:g} rad/s" if point.speed else ""
        value = amount(point.value, point.quantity.unit)
        return f"{point.quantity.name} = {value}, friction {point.friction}{moving}"

    @property
    def subject(self) -> Subject:
        """What a report says of plant and operating point."""
        plant = self.plant
        return Subject(plant.name, plant.summary, self.name, self.par, self.point_text)


@dataclass(frozen=True)
class LinearizedPlant(Answer):
    """The linear model of a plant.

    Parameters
    ----------
    case
        The plant, its parameters and its operating point.
    model
        From its inputs to its outputs; ``model.state_space()`` is python-control's.
    reduced
        The model with fewer states; None where none was asked for.
    """

    case: PlantCase
    model: LinearModel
    reduced: Reduced | None = None

    @property
    def notes(self) -> list[str]:
        """On which side of corners the model is."""
        return texts.corner_notes([self.model.corners])

    @cached_property
    def exact(self) -> LinearModel | None:
        """The model that this one simplifies; None where it is exact."""
        return self.case.plant.exact(self.case.par, self.case.point)

    @cached_property
    def error(self) -> ReductionError | None:
        """How far it is from the exact model; None where it is exact."""
        if self.exact is None:
            return None
        return reduction_error(self.exact, self.model, self.case.plant.band)

    def document(self) -> Document:
        """Return poles and responses, beside those of the exact and the reduced model."""
        case, model = self.case, self.model
        head = (
            f"plant {case.plant.name} of {case.name} at {case.point_text}: {len(model.states)} "
            f"states, from {', '.join(model.inputs)} to {', '.join(model.outputs)}"
        )
        return Document(
            f"Linear model of {case.plant.name}",
            case.subject.line,
            sections=self._sections,
            brief=[head, *texts.poles_block(model), *self._notes(), *self._brief_reduced()],
            data=self._data(),
            attachments=[texts.json_file(f"{case.plant.name}-linear-model.json", self._data())],
            changes=case.subject.changes,
        )

    def _brief_reduced(self) -> list[str | Flat]:
        if self.reduced is None:
            return []
        return [texts.reduced_line(self.reduced), *texts.poles_block(self.reduced.model)]

    def _notes(self) -> list[str]:
        """Return what friction makes of the model, or how far it is from the whole plant."""
        if not self.model.effective():
            return ["nothing that the inputs reach moves an output: what friction holds, rests"]
        if self.error is None:
            return []
        return [f"against the whole plant: {texts.error_line(self.error)}"]

    def _sections(self) -> list[Section]:
        case, notes = self.case, self._notes()
        models = {case.plant.name: self.model}
        if self.exact is not None:
            models = {"exact": self.exact, **models}
        if self.reduced is not None:
            models[f"reduced to {len(self.reduced.model.states)} states"] = self.reduced.model
            notes.append(texts.reduced_line(self.reduced))
        poles: list[Block] = [Listing(notes)] if notes else []
        for label, model in models.items():
            poles += texts.poles_block(model, f"Poles of {label}, slowest first.")
        from bywire.report.plant_figures import plant_figures

        figures: list[Block] = [
            FigureBlock(figure, f"Frequency response of {name}.", f"{case.plant.name}-{name}")
            for name, figure in plant_figures(models, case.plant.band)
        ]
        return [
            Section("Poles", poles),
            Section("Figures", figures or [Paragraph("No output answers the first input.")]),
            case.subject.provenance(_MADE),
        ]

    def _data(self) -> dict[str, Any]:
        point = self.case.point
        shown: dict[str, Any] = {
            "plant": self.case.plant.name,
            "parameters": self.case.name,
            "operating_point": {point.quantity.name: point.value, "unit": point.quantity.unit},
            "friction": point.friction,
            "speed": point.speed,
            **texts.matrices(self.model),
            "stable": self.model.is_stable,
        }
        if self.error is not None:
            shown["error"] = texts.error_object(self.error)
        if self.reduced is not None:
            shown["reduced"] = texts.reduced_object(self.reduced)
        return shown


@dataclass(frozen=True)
class PlantLocus(Answer):
    """The poles of a plant over a range of a parameter or of its operating point."""

    case: PlantCase
    locus: Locus

    def document(self) -> Document:
        """Return where the plant turns unstable, and its root locus."""
        case, point = self.case, self.case.point
        name = case.plant.name
        listing = Listing(texts.locus_lines(self.locus))
        value = amount(point.value, point.quantity.unit)
        head = (
            f"plant {name} of {case.name} at {point.quantity.name} = {value}, over "
            f"{self.locus.name}:"
        )
        data = {"plant": name, "parameters": case.name, "locus": texts.locus_object(self.locus)}
        figure = FigureBlock(
            partial(_draw_locus, self.locus), f"Poles against {self.locus.name}.", f"{name}-locus"
        )
        return Document(
            f"Root locus of {name}",
            case.subject.line,
            sections=lambda: [
                Section(f"Stability over {self.locus.name}", [listing]),
                Section("Figures", [figure]),
                case.subject.provenance(_MADE),
            ],
            brief=[head, listing],
            data=data,
            attachments=[texts.json_file(f"{name}-locus.json", data)],
            changes=case.subject.changes,
        )


def linearize_plant(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    reduce: str,
    side: str = "",
) -> LinearizedPlant:
    """Return the linear model of a plant; see `bywire.linearize`."""
    case = plant_case(name, parameters, at, overrides, friction, speed, side)
    model = case.plant.linear(case.par, case.point)
    reduced = texts.reduced(model, reduce, case.plant.band) if reduce else None
    return LinearizedPlant(case, model, reduced)


def plant_locus(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    range_: str,
    side: str = "",
) -> PlantLocus:
    """Return the poles of a plant over a range; see `bywire.linearize`."""
    case = plant_case(name, parameters, at, overrides, friction, speed, side)
    quantity = case.point.quantity
    over, unit, values = range_of(range_, quantity, case.par, "locus")

    def model(value: float) -> LinearModel:
        if over == quantity.name:
            return case.plant.linear(case.par, replace(case.point, value=value))
        return case.plant.linear(case.par.replace({over: value}), case.point)

    return PlantLocus(case, locus_of(model, over, unit, sorted(values)))


def plant_case(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    side: str = "",
) -> PlantCase:
    """Return a plant with its parameters and its operating point.

    Parameters
    ----------
    name
        Plant.
    parameters
        Parameter set; empty for the main one of the plant's brake.
    at
        Operating point; its unit says what it is. Empty for the plant's own.
    overrides
        Parameters by dotted name, with units.
    friction, speed
        What dry friction does, and how fast the motors turn; empty: removed, at rest.
    side
        As of `loop_case`.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and sets of another brake.
    """
    read_sides(side)
    plant = replace(PLANTS.find(name), side=side)
    chosen_set, par = parameters_for(f"plant {plant.name!r}", plant.assembly, parameters, overrides)
    quantity, value = _operating_point(plant, at)
    kind, omega = _friction(friction, speed)
    return PlantCase(plant, chosen_set, par, PlantPoint(quantity, value, kind, omega))


def _operating_point(plant: Plant, at: str) -> tuple[Quantity, float]:
    if not at:
        return plant.at[0], plant.at[0].default
    for quantity in plant.at:
        try:
            return quantity, number(at, quantity.unit, quantity.name)
        except UnitError:
            continue
    known = ", ".join(f"{quantity.name} in {quantity.unit}" for quantity in plant.at)
    raise UnitError(f"{option('at')} {at!r}: {plant.name} takes one of {known}")


def _friction(friction: str, speed: str) -> tuple[Friction, float]:
    kinds: tuple[Friction, ...] = get_args(Friction)
    kind = next((each for each in kinds if each == (friction or "removed")), None)
    if kind is None:
        raise unknown_name("kind of friction", friction, kinds)
    omega = number(speed, "rad/s", option("speed")) if speed else 0.0
    if kind == "sliding" and omega == 0.0:
        raise ParameterError(
            f"{option('friction', 'sliding')}: friction at rest has no slope; give the motors' "
            f"speed with {option('speed')}, for instance '5 rad/s', positive toward clamping"
        )
    if kind != "sliding" and omega != 0.0:
        raise ParameterError(
            f"{option('speed')} {speed}: only sliding friction depends on it: add "
            f"{option('friction', 'sliding')}, or "
            "leave it out"
        )
    return kind, omega


def _draw_locus(locus: Locus) -> Figure:
    from bywire.report.poles import root_locus

    return root_locus(locus, math.nan)
