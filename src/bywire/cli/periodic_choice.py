"""``bywire linearize --dither``: the loop about its motion under dither, friction left on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from bywire.analysis.linear.rates import rates
from bywire.analysis.periodic.averaged_map import PeriodicModel, dithered_loop
from bywire.api.loop_case import LoopCase
from bywire.core.errors import ParameterError
from bywire.core.signals import signals_of
from bywire.report.wording import amount


def dithered(chosen: LoopCase) -> PeriodicModel:
    """Return the loop's linear model about its periodic motion.

    Raises
    ------
    ParameterError
        When nothing in the loop is periodic.
    SolverError
        When the motion under dither does not repeat itself.
    """
    if not chosen.loop.whole(chosen.par):
        raise ParameterError(
            f"--dither: loop {chosen.loop.name!r} of {chosen.name} has none; it takes a loop "
            "through which a dither runs (pressure), with ecu.dither.waveform other than off"
        )
    return dithered_loop(chosen.loop, chosen.par, chosen.value)


def as_object(model: PeriodicModel) -> dict[str, Any]:
    """Return the JSON object: the averaged map, and the motion that it is about."""
    linear = model.averaged
    return {
        "period": linear.period,
        "A": linear.A.tolist(), "B": linear.B.tolist(), "C": linear.C.tolist(),
        "D": linear.D.tolist(),
        "states": list(linear.states), "inputs": list(linear.inputs),
        "outputs": list(linear.outputs),
        "poles": [[float(z.real), float(z.imag)] for z in linear.poles()],
        "rates": [[float(s.real), float(s.imag)] for s in rates(linear)],
        "stable": linear.is_stable,
        "mean": model.mean,
        "ripple": model.ripple,
        "steady_gain": model.steady_gain,
        "stuck": model.orbit.stuck,
        "distance": model.orbit.distance,
    }  # fmt: skip


def write(model: PeriodicModel, out: Path, loop: str) -> Path:
    """Write the averaged map as JSON into a folder, and return its path."""
    from bywire.report.files import write_bytes

    content = json.dumps(as_object(model), indent=1).encode()
    return write_bytes(out / f"{loop}-dithered-model.json", content)


def text(model: PeriodicModel, band: tuple[float, float]) -> str:
    """Return what people read: the motion, its poles, the response beside them."""
    from bywire.report.rate_table import left_out, rate_table
    from bywire.report.table_text import table_text

    linear = model.averaged
    highest = min(band[1], 0.5 / linear.period)
    frequencies = np.geomspace(band[0], highest, 5)
    gains = ", ".join(
        f"{abs(h):.3g} at {f:.3g} Hz"
        for f, h in zip(frequencies, model.response(frequencies), strict=True)
    )
    table = table_text(rate_table(linear))
    return "\n".join([head(model), table, *left_out(linear), f"gain to small sines: {gains}"])


def head(model: PeriodicModel) -> str:
    """Return the motion that the model is about as a line."""
    linear = model.averaged
    unit = signals_of(model.run.model.Output)[model.output].unit
    stable = "stable" if linear.is_stable else "UNSTABLE"
    return (
        f"with friction and dither, averaged over {linear.period * 1e3:g} ms: {stable}; "
        f"{model.output} = {amount(model.mean, unit)} in the mean, "
        f"{amount(model.ripple, unit)} of ripple, stuck {100 * model.orbit.stuck:.3g} % of the "
        f"time, steady gain {model.steady_gain:.4g}"
    )
