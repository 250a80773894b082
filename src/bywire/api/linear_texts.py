"""Texts and JSON objects of linear models: poles, reduced models, root loci, dither."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bywire.analysis.linear.linear_model import STILL, LinearModel, rates
from bywire.analysis.locus import Locus
from bywire.analysis.periodic import PeriodicModel
from bywire.analysis.reduction import TOLERANCE, Reduced, ReductionError, reduce
from bywire.core.callers import option
from bywire.core.errors import ParameterError, quoted
from bywire.core.pairs import DIGITS, read_count
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.core.values import number
from bywire.report.document import Attachment, Flat, Paragraph, TableBlock
from bywire.report.tables import Cell, Table, text_table
from bywire.report.wording import amount

_SAME = 1e-9  # times half the sampling frequency


def rate_table(model: LinearModel) -> Table:
    """Return a table of the poles: rate, frequency and damping ratio, with one row per pair.

    A negative real pole of a sampled model oscillates at half the sampling frequency. The table
    marks this pole, which is single and has no damping ratio. It omits poles at zero (see
    `left_out`).
    """
    rows = []
    for s in rates(model):
        size = abs(s)
        if s.imag < -1e-9 or size < STILL:  # the other pole of a pair; poles at zero
            continue
        values = (s.real, s.imag, size / 2.0 / np.pi, -s.real / size)
        units = ("1/s", "rad/s", "Hz", "1")
        figures = [
            Cell(f"{value:.4g}", value=value, unit=unit)
            for value, unit in zip(values, units, strict=True)
        ]
        if model.period and abs(s.imag * model.period / np.pi - 1.0) < _SAME:
            half = Cell(f"{model.nyquist:.4g} (f_s/2)", value=model.nyquist, unit="Hz")
            figures[2:] = [half, Cell("-", value=np.nan, unit="1")]
        rows.append(figures)
    heading = ("real [1/s]", "imaginary [rad/s]", "frequency [Hz]", "damping ratio")
    return text_table(heading, rows)


def left_out(model: LinearModel) -> list[str]:
    """Return a line about the poles that `rate_table` omits, if any."""
    speeds = rates(model)
    still, dead = int(np.sum(np.abs(speeds) < STILL)), len(model.states) - len(speeds)
    parts = []
    if still:
        parts.append(f"{still} at 0 (not driven, or without restoring force)")
    if dead:
        parts.append(f"{dead} that decay within a sample")
    return [f"other poles: {', '.join(parts)}"] if parts else []


# --- Texts and JSON


def poles_block(model: LinearModel, caption: str = "") -> list[Flat]:
    """Return a table of a model's poles, and a line on omitted poles."""
    return [TableBlock(rate_table(model), caption), *map(Paragraph, left_out(model))]


def json_file(name: str, content: Mapping[str, Any]) -> Attachment:
    """Return a file that contains a JSON object."""
    return Attachment(name, partial(_write_json, content))


def _write_json(content: Mapping[str, Any], path: Path) -> Path:
    from bywire.report.drawing import write_bytes

    return write_bytes(path, json.dumps(content, indent=1).encode())


def matrices(model: LinearModel) -> dict[str, Any]:
    """Return a model's matrices, names and poles, and each path's zeros, poles and factor."""
    return {**state_space(model), "transfer_functions": transfers(model)}


def state_space(model: LinearModel) -> dict[str, Any]:
    """Return a model's matrices, names, units and poles."""
    return {
        "period": model.period,
        "A": model.A.tolist(),
        "B": model.B.tolist(),
        "C": model.C.tolist(),
        "D": model.D.tolist(),
        "states": list(model.states),
        "inputs": list(model.inputs),
        "outputs": list(model.outputs),
        "state_units": list(model.state_units),
        "input_units": list(model.input_units),
        "output_units": list(model.output_units),
        "poles": pairs(model.poles()),
    }


def transfers(model: LinearModel) -> list[dict[str, Any]]:
    """Return the zeros, poles and factor of each path of a model."""
    rows = []
    for output in model.outputs:
        for input in model.inputs:
            path = model.transfer(input, output)
            rows.append(
                {
                    "input": input,
                    "output": output,
                    "unit": path.unit,
                    "factor": path.factor,
                    "zeros": pairs(path.zeros),
                    "poles": pairs(path.poles),
                }
            )
    return rows


def pairs(values: Any) -> list[list[float]]:
    """Return complex numbers as lists [real, imaginary]."""
    return [[float(z.real), float(z.imag)] for z in np.asarray(values, dtype=complex)]


def reduced(model: LinearModel, text: str, band: float | None = None) -> Reduced:
    """Reduce a model to an order or a band.

    Parameters
    ----------
    model
        Full model.
    text
        Order, such as ``"4"``, or band, such as ``"150 Hz"``, over which the error must be at most
        1 %.
    band
        Frequency [Hz] up to which the error is estimated if the text is an order. Default: the
        model's band.

    Raises
    ------
    ParameterError
        If the text is neither an order nor a band, or is out of range.
    UnitError
        If the band has a wrong unit.
    """
    if _is_number(text):
        order = read_count(text)
        if not order:
            raise ParameterError(
                f"{option('reduce')} {quoted(text)} is not valid: an order must be a whole number "
                ">= 1 "
                f"with at most {DIGITS} digits. A band needs a unit, for example '150 Hz'",
                name=option("reduce"),
                value=quoted(text),
                valid="a whole number >= 1",
            )
        return reduce(model, order=order, band=band)
    return reduce(model, band=number(text, "Hz", option("reduce")), tolerance=TOLERANCE)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def reduced_object(reduced: Reduced) -> dict[str, Any]:
    """Return the JSON object of a reduced model."""
    return {
        **matrices(reduced.model),
        "order": len(reduced.model.states),
        "kept": reduced.kept,
        "hankel": reduced.hankel.tolist(),
        "bound": reduced.bound.tolist(),
        "error": error_object(reduced.error),
    }


def corner_notes(corners: Iterable[Sequence[str]]) -> list[str]:
    """Return one note on each side of a kink that linear models use."""
    texts = dict.fromkeys(text for each in corners for text in each)
    return [
        f"the operating point lies on a kink. The linear model is valid {each}" for each in texts
    ]


def reduced_line(reduced: Reduced) -> str:
    """Return a line about a reduced model's order and error."""
    kept = f" ({reduced.kept} of them unstable and unchanged)" if reduced.kept else ""
    return f"reduced to {len(reduced.model.states)} states{kept}, {error_line(reduced.error)}"


def error_object(error: ReductionError) -> dict[str, Any]:
    """Return the JSON object of a reduction error over a band."""
    return {
        "band_Hz": [error.low, error.high],
        "relative": error.relative,
        "gain_dB": error.gain,
        "phase_deg": error.phase,
        "at_Hz": error.at,
        "output": error.channel[0],
        "input": error.channel[1],
        "poles": error.poles,
    }


def error_line(error: ReductionError) -> str:
    """Return a line about a reduction error over a band."""
    return (
        f"maximum error up to {error.high:.4g} Hz: {_percent(error.relative)} "
        f"({error.gain:.2g} dB, {error.phase:.2g} degrees), at {error.at:.3g} Hz"
        + (f" from {error.channel[1]} to {error.channel[0]}" if error.channel[0] else "")
        + ("" if math.isnan(error.poles) else f", error of its poles there {_percent(error.poles)}")
    )


def _percent(share: float) -> str:
    return amount(100.0 * share, "percent", 2)


def locus_object(locus: Locus) -> dict[str, Any]:
    """Return values, poles [real, imaginary] at each value, and stability limits."""
    return {
        "over": locus.name,
        "unit": locus.unit,
        "values": locus.values.tolist(),
        "period": locus.period,
        "poles": [pairs(row) for row in locus.poles],
        "stable": [bool(stable) for stable in locus.stable],
        "borders": [
            {"value": b.value, "rate": [b.rate.real, b.rate.imag], "stable_above": b.above}
            for b in locus.borders
        ],
    }


def locus_lines(locus: Locus) -> list[str]:
    """Return a line about each stability limit over the range."""
    from bywire.report.poles import border_text

    if not locus.borders:
        state = "stable" if locus.stable.all() else "unstable"
        return [f"{state} at all {len(locus.values)} values"]
    return [border_text(border, locus.name, locus.unit) for border in locus.borders]


def dithered_object(model: PeriodicModel) -> dict[str, Any]:
    """Return the JSON object of an averaged map and its periodic motion."""
    linear = model.averaged
    shown = state_space(linear)
    names = ("period", "A", "B", "C", "D", "states", "inputs", "outputs", "poles")
    return {
        **{name: shown[name] for name in names},
        "rates": pairs(rates(linear)),
        "stable": linear.is_stable,
        "mean": model.mean,
        "ripple": model.ripple,
        "steady_gain": model.steady_gain,
        "stuck": model.orbit.stuck,
        "distance": model.orbit.distance,
    }


def dithered_line(model: PeriodicModel) -> str:
    """Return a line on the periodic motion about which a model is linearized."""
    linear = model.averaged
    unit = signals_of(model.run.model.Output)[model.output].unit
    stable = "stable" if linear.is_stable else "UNSTABLE"
    return (
        f"with friction and dither, averaged over {linear.period * 1e3:g} ms: {stable}; mean of "
        f"{model.output} {amount(model.mean, unit)}, ripple "
        f"{amount(model.ripple, unit)}, stuck {100 * model.orbit.stuck:.3g} % of the "
        f"time, steady gain {model.steady_gain:.4g}"
    )


def small_sines(model: PeriodicModel, band: tuple[float, float]) -> Array:
    """Return five frequencies [Hz] of a band, all below the Nyquist frequency."""
    return np.geomspace(band[0], min(band[1], 0.5 / model.averaged.period), 5)


def small_gains_line(model: PeriodicModel, band: tuple[float, float], error: float) -> str:
    """Return a line on the gain for small sines at five frequencies of a band [Hz].

    ``error`` is the maximum relative numerical error of these gains.
    """
    frequencies = small_sines(model, band)
    known = f"{100 * error:.1g} %" if math.isfinite(error) else "unknown, because not periodic"
    gains = ", ".join(
        f"{abs(h):.3g} at {f:.3g} Hz"
        for f, h in zip(frequencies, model.response(frequencies), strict=True)
    )
    return f"gain for small sines: {gains} (numerical error, from half steps: {known})"
