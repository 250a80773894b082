"""Panels of recordings whose model declares none: signals by unit, with their set points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.report.panels import Role, declared_panels, panels_by_unit
from bywire.report.time_traces import time_traces

T = np.linspace(0.0, 1.0, 51)


def recording(**signals: tuple[str, str, Any]) -> xr.Dataset:
    """Return a recording of an unknown model: unit, label and values of each signal."""
    return xr.Dataset(
        {
            name: (
                "time",
                np.broadcast_to(np.asarray(y, float), T.shape),
                {"units": unit, "long_name": label},
            )
            for name, (unit, label, y) in signals.items()
        },
        coords={"time": T},
        attrs={"model": "somebody's axis"},
    )


OWN = recording(
    angle=("rad", "angle of the motor", T),
    target=("rad", "demand", 1.0),
    F=("N", "clamp force", 2.0 * T),
    F_pad=("N", "pad force", T),
    F_hat=("N", "estimate", T),
    at_stop=("1", "at its stop", T > 0.5),
    E_source=("J", "energy", T),
    duty=("1", "duty cycle", 0.5 * T),
)


def test_signals_of_a_unit_share_panels_two_by_two() -> None:
    assert declared_panels(OWN) == []
    own = OWN.copy()
    own["target"].attrs["set_point_of"] = "angle"
    panels = panels_by_unit(own)
    drawn = [[(trace.variable, trace.role) for trace in panel.traces] for panel in panels]
    assert drawn == [
        [("angle", Role.MAIN), ("target", Role.SET_POINT)],
        [("F", Role.MAIN), ("F_pad", Role.SECOND)],
        [("F_hat", Role.MAIN)],
        [("duty", Role.MAIN)],
    ]
    assert [panel.quantity for panel in panels] == [
        "angle of the motor",
        "force",
        "estimate",
        "duty cycle",
    ]
    assert len(time_traces(own).axes) == 4


def test_without_a_declaration_a_set_point_is_a_line_like_any_other() -> None:
    first = panels_by_unit(OWN)[0]
    assert [trace.role for trace in first.traces] == [Role.MAIN, Role.SECOND]


def test_energies_and_modes_alone_draw_nothing() -> None:
    with pytest.raises(ParameterError, match="no panel"):
        time_traces(OWN[["E_source", "at_stop"]])


def test_signals_of_different_sizes_have_panels_of_their_own() -> None:
    own = recording(
        s=("m", "distance", 70.0 * T), u=("m", "tire deflection", 2e-3 * T), x=("m", "way", 9.0 * T)
    )
    drawn = [[trace.variable for trace in panel.traces] for panel in panels_by_unit(own)]
    assert drawn == [["s", "x"], ["u"]]


def test_a_panel_of_unlike_labels_is_named_by_its_quantity() -> None:
    own = recording(F=("N", "braking force of the tire", T), N=("N", "load of the wheel", T))
    assert [panel.quantity for panel in panels_by_unit(own)] == ["force"]
