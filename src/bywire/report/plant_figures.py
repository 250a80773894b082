"""Figures of a plant's linear models: the frequency response of every output."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.quantities import display_unit
from bywire.core.units import display_factor
from bywire.report.bode import Response, bode
from bywire.report.wording import unit_text

_POINTS = 400
_DECADES = 3.0
_APART = 16  # of the points that show a model beside the first one


def plant_figures(models: Mapping[str, LinearModel], band: float) -> list[tuple[str, Figure]]:
    """Return name and figure of every output that answers the first input.

    ``models``: label -> model, of the same inputs and outputs; ``band``: end of the frequencies
    [Hz].
    """
    f = np.geomspace(band * 10.0**-_DECADES, band, _POINTS)
    first = next(iter(models.values()))
    values = {label: model.response(f) for label, model in models.items()}
    taken, drawn = first.input_units[0], []
    for row, (signal, given) in enumerate(zip(first.outputs, first.output_units, strict=True)):
        if not any(np.any(response[:, row, 0]) for response in values.values()):
            continue
        shown = display_unit(given)
        scale = display_factor(given) / display_factor(taken)
        unit = f"{unit_text(shown) or '1'}/{unit_text(display_unit(taken)) or '1'}"
        lines = []
        for k, (label, response) in enumerate(values.items()):
            # Points on top of a line: models that agree would hide each other.
            some = slice(None) if k == 0 else slice(k * _APART // 2, None, _APART)
            path = f"{label}, {signal} by {first.inputs[0]}"
            lines.append(Response(path, f[some], scale * response[some, row, 0], measured=k > 0))
        drawn.append((signal, bode(lines, gain_unit=unit)))
    return drawn
