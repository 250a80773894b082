"""``bywire linearize``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bywire.analysis.linear_model import LinearModel
from bywire.cli import output
from bywire.cli.loop_choice import Chosen, choose
from bywire.cli.output_folder import require_folder
from bywire.report.wording import amount


def execute(
    loop: str,
    parameters: str,
    at: str,
    changes: Mapping[str, str],
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the exact linear model of a closed loop, or its poles."""
    if out is not None:
        require_folder(out)
    chosen = choose(loop, parameters, at, changes)
    model = chosen.loop.closed(chosen.par, chosen.value)
    if out is not None:
        from bywire.report.files import write_bytes

        text = json.dumps(as_object(chosen, model), indent=1)
        path = write_bytes(out / f"{loop}-linear-model.json", text.encode())
        output.message(f"model: {path}")
    if as_json:
        output.result(json.dumps(as_object(chosen, model)))
    else:
        output.result(_text(chosen, model))


def as_object(chosen: Chosen, model: LinearModel) -> dict[str, Any]:
    """Return the JSON object of a model: matrices with names and units, poles."""
    rates = continuous(model)
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
        "rates": [[float(s.real), float(s.imag)] for s in rates],
        "stable": model.is_stable,
    }  # fmt: skip


def continuous(model: LinearModel) -> Any:
    """Return the poles as rates of continuous motions [1/s], slowest first; dead beats left out."""
    poles = model.poles()
    rates = np.log(poles[np.abs(poles) > 1e-9].astype(complex)) / model.period
    return rates[np.argsort(np.abs(rates))]


def _text(chosen: Chosen, model: LinearModel) -> str:
    from bywire.report.table_text import table_text
    from bywire.report.tables import text_table

    rows = []
    for s in continuous(model):
        if s.imag < -1e-9 or abs(s) < 1e-6:  # the other of a pair; what does not move
            continue
        size = abs(s)
        figures = (s.real, s.imag, size / 2.0 / np.pi, -s.real / size)
        rows.append([f"{figure:.4g}" for figure in figures])
    stable = "stable" if model.is_stable else "UNSTABLE"
    loop = chosen.loop
    head = (
        f"closed loop {loop.name} of {chosen.name} at {loop.at.name} = "
        f"{amount(chosen.value, loop.at.unit)}: {stable}, sampled with {model.period * 1e3:g} ms\n"
    )
    heading = ("real [1/s]", "imaginary [rad/s]", "frequency [Hz]", "damping ratio")
    return head + table_text(text_table(heading, rows))
