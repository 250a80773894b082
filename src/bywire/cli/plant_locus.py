"""``bywire linearize --locus`` of a plant."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.locus import Locus, locus_of
from bywire.api.loop_case import range_of
from bywire.cli import output
from bywire.cli.locus_object import locus_object
from bywire.cli.output_folder import require_folder
from bywire.cli.plant_choice import ChosenPlant, choose, subject
from bywire.report.wording import amount


def execute(
    plant: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    friction: tuple[str, str],
    range_: str,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print where a plant turns unstable over a range of a parameter, and draw its poles."""
    if out is not None:
        require_folder(out)
    chosen = choose(plant, parameters, at, changes, *friction)
    quantity = chosen.point.quantity
    name, unit, values = range_of(range_, quantity, chosen.par, "--locus")

    def model(value: float) -> LinearModel:
        if name == quantity.name:
            return chosen.plant.model(chosen.par, replace(chosen.point, value=value))
        return chosen.plant.model(chosen.par.replace({name: value}), chosen.point)

    found = locus_of(model, name, unit, sorted(values))
    files = [] if out is None else _written(chosen, found, out)
    if as_json:
        shown = _as_object(chosen, found)
        output.result(json.dumps({**shown, "files": [str(path) for path in files]}))
    else:
        output.result(_text(chosen, found))
    for path in files:
        output.message(f"written: {path}")


def _written(chosen: ChosenPlant, found: Locus, out: Path) -> list[Path]:
    from bywire.report.files import write_bytes
    from bywire.report.plant_report import write_plant_locus

    content = json.dumps(_as_object(chosen, found), indent=1).encode()
    path = write_bytes(out / f"{chosen.plant.name}-locus.json", content)
    return [path, *write_plant_locus(out, subject(chosen), found)]


def _as_object(chosen: ChosenPlant, found: Locus) -> dict[str, Any]:
    return {
        "plant": chosen.plant.name, "parameters": chosen.name, "locus": locus_object(found)
    }  # fmt: skip


def _text(chosen: ChosenPlant, found: Locus) -> str:
    from bywire.report.linearize_report import locus_texts

    point = chosen.point
    head = (
        f"plant {chosen.plant.name} of {chosen.name} at {point.quantity.name} = "
        f"{amount(point.value, point.quantity.unit)}, over {found.name}:"
    )
    return "\n".join([head, *(f"- {text}" for text in locus_texts(found))])
