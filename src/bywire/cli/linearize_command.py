"""``bywire linearize``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.rates import rates
from bywire.analysis.locus import Locus, locus
from bywire.analysis.periodic.averaged_map import PeriodicModel
from bywire.api.loop_case import LoopCase, loop_case, over_range
from bywire.cli import output, periodic_choice, reduction_choice
from bywire.cli.locus_object import locus_object
from bywire.cli.output_folder import require_folder
from bywire.report.wording import amount


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    range_: str,
    reduce: str,
    dither: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the exact linear model of a closed loop, or its poles and where it turns unstable."""
    if out is not None:
        require_folder(out)
    chosen = loop_case(loop, parameters, at, changes)
    model = chosen.loop.closed(chosen.par, chosen.value)
    found = _locus(chosen, range_) if range_ else None
    less = reduction_choice.reduced(model, reduce, chosen.loop.band[1]) if reduce else None
    shaken = periodic_choice.dithered(chosen) if dither else None
    files = [] if out is None else _written(chosen, model, found, shaken, out)
    if shaken is not None and out is not None:
        files.append(periodic_choice.write(shaken, out, chosen.loop.name))
    if as_json:
        shown = as_object(chosen, model)
        if found is not None:
            shown["locus"] = locus_object(found)
        if less is not None:
            shown["reduced"] = reduction_choice.as_object(less)
        if shaken is not None:
            shown["dithered"] = periodic_choice.as_object(shaken)
        output.result(json.dumps({**shown, "files": [str(path) for path in files]}))
    else:
        output.result(_text(chosen, model, found))
        if less is not None:
            output.result(reduction_choice.text(less))
        if shaken is not None:
            output.result(periodic_choice.text(shaken, chosen.loop.band))
    for path in files:
        output.message(f"written: {path}")


def _locus(chosen: LoopCase, range_: str) -> Locus:
    name, unit, values = over_range(range_, chosen, "--locus")
    return locus(chosen.loop, chosen.par, chosen.value, name, unit, sorted(values))


def _written(
    chosen: LoopCase,
    model: LinearModel,
    found: Locus | None,
    shaken: PeriodicModel | None,
    out: Path,
) -> list[Path]:
    from bywire.report.files import write_bytes
    from bywire.report.linearize_report import own_bandwidth, write_model

    loop = chosen.loop
    text = json.dumps(as_object(chosen, model), indent=1)
    path = write_bytes(out / f"{loop.name}-linear-model.json", text.encode())
    models = [model]
    if found is not None:
        ends = (float(found.values[0]), float(found.values[-1]))
        cases = loop.varied(chosen.par, chosen.value, found.name, ends)
        models += [loop.closed(*case) for case in cases]
    widest = max((own_bandwidth(one) for one in models if one.is_stable), default=float("nan"))
    told = None if shaken is None else (shaken, periodic_choice.head(shaken))
    return [path, *write_model(out, chosen.subject, model, found, widest, told)]


def as_object(chosen: LoopCase, model: LinearModel) -> dict[str, Any]:
    """Return the JSON object of a model: matrices with names and units, poles."""
    found = rates(model)
    return {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "period": model.period,
        "A": model.A.tolist(), "B": model.B.tolist(), "C": model.C.tolist(), "D": model.D.tolist(),
        "states": list(model.states), "inputs": list(model.inputs), "outputs": list(model.outputs),
        "state_units": list(model.state_units), "input_units": list(model.input_units),
        "output_units": list(model.output_units),
        "poles": [[float(z.real), float(z.imag)] for z in model.poles()],
        "rates": [[float(s.real), float(s.imag)] for s in found],
        "stable": model.is_stable,
        "transfer_functions": reduction_choice.transfers(model),
    }  # fmt: skip


def _text(chosen: LoopCase, model: LinearModel, found: Locus | None) -> str:
    from bywire.report.linearize_report import locus_texts
    from bywire.report.rate_table import left_out, rate_table
    from bywire.report.table_text import table_text

    stable = "stable" if model.is_stable else "UNSTABLE"
    loop = chosen.loop
    lines = [
        f"closed loop {loop.name} of {chosen.name} at {loop.at.name} = "
        f"{amount(chosen.value, loop.at.unit)}: {stable}, sampled with {model.period * 1e3:g} ms",
        table_text(rate_table(model)),
        *left_out(model),
    ]
    if found is not None:
        lines += [f"over {found.name}:", *(f"- {text}" for text in locus_texts(found))]
    return "\n".join(lines)
