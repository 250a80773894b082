"""``--reduce``: what is asked for, and what is said of a reduced model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.reduction.error import ReductionError
from bywire.analysis.reduction.reduce import TOLERANCE, Reduced, reduce
from bywire.bench.values import number
from bywire.core.errors import ParameterError, quoted
from bywire.report.wording import amount

_DIGITS = 9  # of an order: more is no order


def reduced(model: LinearModel, text: str, band: float | None = None) -> Reduced:
    """Return the reduced model that ``--reduce`` asks for.

    Parameters
    ----------
    model
        Full model.
    text
        An order, ``"4"``, or a band, ``"150 Hz"``: as few states as 1 % of error allows there.
    band
        Frequency [Hz] up to which the error of an order is told; the model's own where None.

    Raises
    ------
    ParameterError
        When it is neither, or out of range.
    UnitError
        When the band has a wrong unit.
    """
    if _is_number(text):
        if not text.strip().isdecimal() or not int(text):
            raise ParameterError(
                f"--reduce {quoted(text)}: an order is a whole number >= 1; with a unit, it is a "
                "band, for instance '150 Hz'"
            )
        if len(text.strip()) > _DIGITS:
            raise ParameterError(f"--reduce {quoted(text)}: no model has so many states")
        return reduce(model, order=int(text), band=band)
    return reduce(model, band=number(text, "Hz", "--reduce"), tolerance=TOLERANCE)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def as_object(found: Reduced) -> dict[str, Any]:
    """Return the JSON object of a reduced model."""
    return {
        **matrices(found.model),
        "order": len(found.model.states),
        "kept": found.kept,
        "hankel": found.hankel.tolist(),
        "bound": found.bound.tolist(),
        "error": error_object(found.error),
    }


def error_object(error: ReductionError) -> dict[str, Any]:
    """Return the JSON object of an error over a band."""
    return {
        "band_Hz": [error.low, error.high],
        "relative": error.relative,
        "gain_dB": error.gain,
        "phase_deg": error.phase,
        "at_Hz": error.at,
        "output": error.channel[0],
        "input": error.channel[1],
        "poles": None if math.isnan(error.poles) else error.poles,
    }


def matrices(model: LinearModel) -> dict[str, Any]:
    """Return matrices, names and poles of a model, and zeros, poles and factor of each path."""
    return {
        "period": model.period,
        "A": model.A.tolist(), "B": model.B.tolist(), "C": model.C.tolist(), "D": model.D.tolist(),
        "states": list(model.states), "inputs": list(model.inputs), "outputs": list(model.outputs),
        "state_units": list(model.state_units), "input_units": list(model.input_units),
        "output_units": list(model.output_units),
        "poles": pairs(model.poles()),
        "transfer_functions": transfers(model),
    }  # fmt: skip


def transfers(model: LinearModel) -> list[dict[str, Any]]:
    """Return zeros, poles and factor of every path of a model."""
    found = []
    for output in model.outputs:
        for input in model.inputs:
            one = model.transfer(input, output)
            found.append({
                "input": input, "output": output, "unit": one.unit, "factor": one.factor,
                "zeros": pairs(one.zeros), "poles": pairs(one.poles),
            })  # fmt: skip
    return found


def pairs(values: Any) -> list[list[float]]:
    """Return complex numbers as lists of two."""
    return [[float(z.real), float(z.imag)] for z in np.asarray(values, dtype=complex)]


def error_text(error: ReductionError) -> str:
    """Return an error over a band as a line."""
    return (
        f"largest error up to {error.high:.4g} Hz: {_percent(error.relative)} "
        f"({error.gain:.2g} dB, {error.phase:.2g} degrees), at {error.at:.3g} Hz"
        + (f" in {error.channel[0]} by {error.channel[1]}" if error.channel[0] else "")
        + ("" if math.isnan(error.poles) else f"; its poles there {_percent(error.poles)} off")
    )


def _percent(share: float) -> str:
    return amount(100.0 * share, "percent", 2)


def head(found: Reduced) -> str:
    """Return order and error of a reduced model as a line."""
    kept = f", {found.kept} of them kept as they are not stable" if found.kept else ""
    return f"reduced to {len(found.model.states)} states{kept}; {error_text(found.error)}"


def text(found: Reduced) -> str:
    """Return the lines on a reduced model: order, error, bound, poles."""
    from bywire.report.rate_table import left_out, rate_table
    from bywire.report.table_text import table_text

    table = table_text(rate_table(found.model))
    return "\n".join((head(found), table, *left_out(found.model)))
