"""``bywire study``."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from bywire.api.parameter_choice import set_for
from bywire.bench.values import parsed
from bywire.cli import output
from bywire.cli.output_folder import require_folder
from bywire.cli.progress import progress_bar
from bywire.core.errors import unknown_name
from bywire.core.parameters import ParameterSet
from bywire.synthesis.study import STUDIES, Found, Study


def execute(
    name: str, parameters: str, changes: Mapping[str, str], out: Path | None, as_json: bool
) -> None:
    """Compare designs of a brake, and show the best of them."""
    study = STUDIES.find(name)
    found_set = set_for(f"study {study.name!r}", study.assembly, parameters)
    par, options = _changed(study, found_set.parameters(), changes)
    if out is not None:
        require_folder(out)
    with progress_bar() as progress:
        found = study.compute(par, options, progress)
    made_of = (found_set.name, par, options)
    files = [] if out is None else _written(study, made_of, found, out)
    for text in found.warnings:
        output.message(f"warning: {text}")
    if as_json:
        shown = _as_object(study, found_set.name, options, found, files)
        output.result(json.dumps(shown))
    else:
        output.result(_text(study, found_set.name, found))
    for path in files:
        output.message(f"written: {path}")


def _changed(
    study: Study, par: ParameterSet, changes: Mapping[str, str]
) -> tuple[ParameterSet, ParameterSet]:
    """Return parameters and options: names with a dot are the brake's, others the study's."""
    own = {name: value for name, value in changes.items() if "." not in name}
    options = study.defaults.flat()
    for name in own:
        if name not in options:
            raise unknown_name("option", name, (*options, *par.flat()))
    others = {name: value for name, value in changes.items() if "." in name}
    study.require_effect(others)
    return (
        par.replace(parsed(type(par), others, "parameter")),
        study.defaults.replace(parsed(study.options, own, "option")),
    )


def _written(
    study: Study, made_of: tuple[str, ParameterSet, ParameterSet], found: Found, out: Path
) -> list[Path]:
    from bywire.data.netcdf import write_recording
    from bywire.report.contour import contour
    from bywire.report.files import save_figure
    from bywire.report.study_report import write_study
    from bywire.report.subject import Subject

    name, par, options = made_of
    files = [write_recording(found.data, out / f"{study.name}.nc")]
    figures = {kind: contour(found.data, shown) for kind, shown in found.maps.items()}
    for kind, figure in figures.items():
        files.append(save_figure(figure, out / f"{study.name}-{kind}.png"))
    subject = Subject(study.name, study.summary, name, par)
    return [*files, write_study(out, study, subject, options, found, figures)]


def _as_object(
    study: Study, parameters: str, options: ParameterSet, found: Found, files: list[Path]
) -> dict[str, Any]:
    return {
        "study": study.name,
        "parameters": parameters,
        "options": options.model_dump(mode="json"),
        "assumptions": list(found.assumptions),
        "limits": list(found.limits),
        "kpis": {
            one.name: {
                "value": _finite(one.value),
                "unit": one.unit,
                "definition": one.definition,
                "note": one.note,
            }
            for one in found.kpis
        },
        "designs": _listed(found.data),
        "figures": {name: shown.caption for name, shown in found.maps.items()},
        "warnings": list(found.warnings),
        "files": [str(path) for path in files],
    }


def _listed(data: xr.Dataset) -> dict[str, Any]:
    """Return coordinates and variables with their dimensions and units."""
    return {
        str(name): {
            "dims": [str(dim) for dim in values.dims],
            "unit": values.attrs["units"],
            "values": _finite(np.asarray(values.values, dtype=float).tolist()),
        }
        for name, values in data.variables.items()
    }


def _finite(value: Any) -> Any:
    """Return numbers with null for what is infinite or not defined: JSON has no such numbers."""
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return value if math.isfinite(value) else None


def _text(study: Study, parameters: str, found: Found) -> str:
    from bywire.report.study_report import cut_table, kpi_rows
    from bywire.report.table_text import table_text
    from bywire.report.tables import kpi_table

    kpis = table_text(kpi_table(kpi_rows(found)))
    parts = [f"study {study.name} of {parameters}: {study.summary}", kpis]
    if found.limits:
        parts.append("what limits the best design\n" + "\n".join(f"- {t}" for t in found.limits))
    parts += [f"{cut.title}\n{table_text(cut_table(cut), 140)}" for cut in found.cuts]
    parts.append("assumptions\n" + "\n".join(f"- {text}" for text in found.assumptions))
    return "\n\n".join(parts)
