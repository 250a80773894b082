"""Overlaid traces: one line per recording, told apart, and nothing that never moves."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.report.overlaid_traces import overlaid_traces

NAMES = {"p_mc": "pressure", "omega": "speed"}


def test_every_recording_has_a_line_of_its_own(recording: xr.Dataset) -> None:
    p = recording["p_mc"]
    nine = {f"mu{k}": recording.assign(p_mc=p.copy(data=(1.0 + 0.1 * k) * p)) for k in range(9)}
    figure = overlaid_traces(nine, {"p_mc": "pressure"})
    (axes,) = figure.axes
    looks = {(line.get_color(), str(line.get_linestyle())) for line in axes.lines}
    assert len(looks) == 9
    assert axes.get_ylabel() == "pressure\n[bar]"
    tops = [float(np.max(np.asarray(line.get_ydata(), dtype=float))) for line in axes.lines]
    top = float(recording["p_mc"].max()) / 1e5
    assert tops == pytest.approx([top * (1.0 + 0.1 * k) for k in range(9)])
    legend = axes.get_legend()
    assert legend is not None
    figure.draw_without_rendering()
    assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_what_never_moves_is_left_out(recording: xr.Dataset) -> None:
    still = recording.assign(omega=0.0 * recording["omega"])
    assert len(overlaid_traces({"a": recording, "b": still}, NAMES).axes) == 2
    assert len(overlaid_traces({"a": still, "b": still[["p_mc"]]}, NAMES).axes) == 1
    with pytest.raises(ParameterError, match="none of the variables omega"):
        overlaid_traces({"a": still}, {"omega": "speed"})
