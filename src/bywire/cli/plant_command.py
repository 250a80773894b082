"""``bywire linearize`` of a plant."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.reduction.error import reduction_error
from bywire.analysis.reduction.reduce import Reduced
from bywire.cli import output, reduction_choice
from bywire.cli.output_folder import require_folder
from bywire.cli.plant_choice import ChosenPlant, choose, point_text, subject


def execute(
    plant: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    friction: str,
    speed: str,
    reduce: str,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the exact linear model of a plant, or its poles; reduced where asked for."""
    if out is not None:
        require_folder(out)
    chosen = choose(plant, parameters, at, changes, friction, speed)
    model = chosen.plant.model(chosen.par, chosen.point)
    made = reduction_choice.reduced(model, reduce, chosen.plant.band) if reduce else None
    shown = _as_object(chosen, model, made)
    files = [] if out is None else _written(chosen, model, made, shown, out)
    if as_json:
        output.result(json.dumps({**shown, "files": [str(path) for path in files]}))
    else:
        output.result(_text(chosen, model, made))
    for path in files:
        output.message(f"written: {path}")


def _written(
    chosen: ChosenPlant, model: LinearModel, made: Reduced | None, shown: Any, out: Path
) -> list[Path]:
    from bywire.report.files import write_bytes
    from bywire.report.plant_report import write_plant

    content = json.dumps(shown, indent=1).encode()
    path = write_bytes(out / f"{chosen.plant.name}-linear-model.json", content)
    models = {chosen.plant.name: model}
    if chosen.plant.whole is not None:
        models = {"exact": chosen.plant.whole(chosen.par, chosen.point), **models}
    notes = _notes(chosen, model)
    if made is not None:
        models[f"reduced to {len(made.model.states)} states"] = made.model
        notes.append(reduction_choice.head(made))
    return [path, *write_plant(out, subject(chosen), models, chosen.plant.band, notes)]


def _as_object(chosen: ChosenPlant, model: LinearModel, made: Reduced | None) -> dict[str, Any]:
    point = chosen.point
    found: dict[str, Any] = {
        "plant": chosen.plant.name,
        "parameters": chosen.name,
        "operating_point": {point.quantity.name: point.value, "unit": point.quantity.unit},
        "friction": point.friction,
        "speed": point.speed,
        **reduction_choice.matrices(model),
        "stable": model.is_stable,
    }
    if chosen.plant.whole is not None:
        exact = chosen.plant.whole(chosen.par, point)
        error = reduction_error(exact, model, chosen.plant.band)
        found["error"] = reduction_choice.error_object(error)
    if made is not None:
        found["reduced"] = reduction_choice.as_object(made)
    return found


def _text(chosen: ChosenPlant, model: LinearModel, made: Reduced | None) -> str:
    from bywire.report.rate_table import left_out, rate_table
    from bywire.report.table_text import table_text

    lines = [
        f"plant {chosen.plant.name} of {chosen.name} at {point_text(chosen.point)}: "
        f"{len(model.states)} states, from {', '.join(model.inputs)} to "
        f"{', '.join(model.outputs)}",
        table_text(rate_table(model)),
        *left_out(model),
        *_notes(chosen, model),
    ]
    if made is not None:
        lines.append(reduction_choice.text(made))
    return "\n".join(lines)


def _notes(chosen: ChosenPlant, model: LinearModel) -> list[str]:
    """Return what friction makes of the model, or how far it is from the whole plant."""
    if not model.effective():
        return ["nothing that the inputs reach moves an output: what friction holds, rests"]
    if chosen.plant.whole is None:
        return []
    exact = chosen.plant.whole(chosen.par, chosen.point)
    error = reduction_error(exact, model, chosen.plant.band)
    return [f"against the whole plant: {reduction_choice.error_text(error)}"]
