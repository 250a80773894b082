"""Poles of a linear model as a table."""

from __future__ import annotations

import numpy as np

from bywire.analysis.linear.linear_model import STILL, LinearModel, rates
from bywire.report.tables import Cell, Table, text_table

_SAME = 1e-9  # of half the sampling frequency


def rate_table(model: LinearModel) -> Table:
    """Return the poles as a table: rate, frequency, damping ratio; of pairs one.

    A negative real pole of a sampled model swings at half the sampling frequency, and is marked:
    it is a single one, of no damping ratio.

    ``model``: poles of what does not move are left out, see `left_out`.
    """
    rows = []
    for s in rates(model):
        size = abs(s)
        if s.imag < -1e-9 or size < STILL:  # the other of a pair; what does not move
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
    """Return a line on the poles that `rate_table` does not show; none where it shows all."""
    speeds = rates(model)
    still, dead = int(np.sum(np.abs(speeds) < STILL)), len(model.states) - len(speeds)
    parts = []
    if still:
        parts.append(f"{still} at 0 (not driven, or not brought back)")
    if dead:
        parts.append(f"{dead} over within a sample")
    return [f"poles besides these: {', '.join(parts)}"] if parts else []
