"""Overlaid traces: one distinct line per recording, and no signal that is constant."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_hex

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.time_traces import overlaid_panels, overlaid_traces

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


def test_a_set_point_below_its_line_has_no_entry(recording: xr.Dataset) -> None:
    def entries(off: float) -> list[str]:
        runs = {}
        for label, scale in (("a", 1.0), ("b", 1.2)):  # each with a set point of its own
            p = scale * recording["p_mc"].values
            runs[label] = recording.assign(
                p_mc=recording["p_mc"].copy(data=p),
                p_ref=recording["p_ref"].copy(data=p + off * np.ptp(p)),
            )
        legend = overlaid_panels(runs).axes[0].get_legend()
        assert legend is not None
        return [text.get_text() for text in legend.get_texts()]

    name = recording["p_ref"].attrs["long_name"]
    assert name in entries(0.1)
    assert name not in entries(0.01)


def test_faults_are_marked_once_where_they_are_there_at_the_same_times(
    recording: xr.Dataset,
) -> None:
    time = recording["time"].values

    def bars(*starts: float) -> list[tuple[float, float, str]]:
        runs = {
            str(start): recording.assign(
                faults=(
                    "time",
                    ((time >= start) & (time < start + 0.1)).astype(float),
                    {"units": "1"},
                )
            )
            for start in starts
        }
        first, *others = overlaid_panels(runs).axes
        assert {len(axes.collections) for axes in others} == {len(first.collections)}
        legend = first.get_legend()
        assert legend is not None
        assert [text.get_text() for text in legend.get_texts()].count("fault") == 1
        return [
            (float(box.x0), float(box.y0), to_hex(bar.get_facecolor()[0]).upper())
            for bar in first.collections
            for box in [bar.get_paths()[0].get_extents()]
        ]

    assert bars(0.2, 0.2) == [(pytest.approx(0.2), 0.0, style.PURPLE)]
    (early, low, blue), (late, high, red) = bars(0.2, 0.5)
    assert (early, late) == (pytest.approx(0.2), pytest.approx(0.5))
    assert low < high
    assert (blue, red) == (style.BLUE, style.VERMILLION)
