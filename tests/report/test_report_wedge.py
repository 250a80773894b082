"""Figures of the wedge brake and its rigs: panels, limits, modes, and sources of energy."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.bench.energy_ledger import role_attributes
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of
from bywire.report.energy_balance import energy_balance
from bywire.report.panels import PANELS
from bywire.report.time_traces import time_traces

T = np.linspace(0.0, 0.5, 501)
ON = (T > 0.1).astype(float)
BRAKING = {
    "M_set": ("N*m", "moment demand", 950.0 * ON),
    "y_M": ("N*m", "moment shown by the sensor", 900.0 * ON),
    "M_B": ("N*m", "braking moment", 905.0 * ON),
    "omega_1": ("rad/s", "motor speed 1", 60.0 * ON),
    "omega_2": ("rad/s", "motor speed 2", 59.0 * ON),
    "sat_rate": ("1", "software rate limit reached", ((T > 0.2) & (T < 0.3)).astype(float)),
    "i_1": ("A", "current 1", -12.0 * ON),
    "i_2": ("A", "current 2", 8.0 * ON),
    "P_in": ("W", "power", 300.0 * ON),
    "P_meas": ("W", "power, filtered", 60.0 * ON),
    "F_M": ("N", "actuation force", 150.0 * ON),
    "mode": ("1", "mode", 2.0 * ON),
    "stuck": ("1", "shafts and wedge stuck", 1.0 - ON),
}
RIG = {
    "theta_1": ("rad", "motor angle 1", T),
    "theta_2": ("rad", "motor angle 2", T),
    "omega_1": ("rad/s", "motor speed 1", 1.0 + 0.0 * T),
    "i_1": ("A", "current 1", 0.5 * T),
    "y_F": ("N", "force shown by the sensor", 1e3 * T),
    "P_el": ("W", "electrical power", T),
}


def recording(signals: dict[str, tuple[str, str, np.ndarray]], i_max: float = 20.0) -> xr.Dataset:
    return xr.Dataset(
        {n: ("time", y, {"units": u, "long_name": text}) for n, (u, text, y) in signals.items()},
        coords={"time": T},
        attrs={"parameters": json.dumps({"drive": {"i_max": i_max}})},
    )


def panels(figure: Figure) -> dict[str, Axes]:
    return {axes.get_ylabel().split("\n")[0]: axes for axes in figure.axes}


def legend(axes: Axes) -> list[str]:
    shown = axes.get_legend()
    return [] if shown is None else [text.get_text() for text in shown.get_texts()]


def energies(**changes: float) -> xr.Dataset:
    """Return a recording in which every energy grows from zero to its value."""
    ramp = T / T[-1]
    found = recording({name: ("J", name, value * ramp) for name, value in changes.items()})
    model = ASSEMBLIES.find("wedge-brake" if "W_disc" in changes else "screw-rig")
    for name, signal in signals_of(model.Output).items():
        if name in changes:
            found[name].attrs |= role_attributes(signal.role)
    return found


def test_panels_are_stacked_as_in_the_paper() -> None:
    drawn = panels(time_traces(recording(BRAKING)))
    assert list(drawn) == ["moment", "motor speed", "current", "power", "force", "mode"]
    assert "at the software rate limit" in legend(drawn["motor speed"])
    assert "shafts and wedge stuck" in legend(drawn["moment"])


def test_mode_is_named_on_its_axis_and_has_no_legend() -> None:
    axes = panels(time_traces(recording(BRAKING)))["mode"]
    names = [tick.get_text() for tick in axes.get_yticklabels()]
    assert names == ["parked", "gap", "moment", "retracting"]
    assert legend(axes) == []


@pytest.mark.parametrize(("i_max", "lines"), [(20.0, [-20.0]), (13.0, [-13.0]), (40.0, [])])
def test_a_limit_is_drawn_on_the_side_where_the_trace_comes_near(
    i_max: float, lines: list[float]
) -> None:
    axes = panels(time_traces(recording(BRAKING, i_max)))["current"]
    drawn = [float(np.asarray(line.get_ydata())[0]) for line in axes.lines[2:]]
    assert drawn == lines


def test_a_recording_without_parameters_has_no_limits() -> None:
    bare = recording(BRAKING)
    bare.attrs = {}
    assert len(panels(time_traces(bare))["current"].lines) == 2


def test_rigs_get_panels_of_their_own() -> None:
    drawn = panels(time_traces(recording(RIG)))
    assert list(drawn) == ["angle", "motor speed", "current", "force", "power"]


def test_a_wedge_brake_under_position_control_shows_angles_and_no_moment() -> None:
    still = {
        name: (u, text, 0.0 * y)
        for name, (u, text, y) in BRAKING.items()
        if name in ("M_set", "y_M", "M_B", "mode", "sat_rate")
    }
    angles = {name: RIG[name] for name in ("theta_1", "theta_2")}
    drawn = panels(time_traces(recording(BRAKING | still | angles)))
    assert "angle" in drawn
    assert not {"moment", "mode"} & drawn.keys()


def test_a_brake_at_rest_still_has_a_figure() -> None:
    still = {name: (u, text, 0.0 * y) for name, (u, text, y) in BRAKING.items()}
    assert "moment" in panels(time_traces(recording(still)))


def test_every_kind_of_panels_names_a_variable_once() -> None:
    for kind in PANELS.all().values():
        names = [trace.variable for panel in kind.panels for trace in panel.traces]
        assert len(names) == len(set(names))
        assert set(kind.assemblies) <= set(ASSEMBLIES.all())
        recorded = {n for name in kind.assemblies for n in ASSEMBLIES.find(name).Output._fields}
        assert set(names) <= recorded


def test_energy_of_the_wedge_brake_comes_from_motors_disc_and_run_out() -> None:
    figure = energy_balance(
        energies(
            W_electric=5.0,
            W_disc=2.0,
            W_runout=-0.5,
            E_source=6.5,
            E_copper=3.0,
            E_shaft=1.5,
            E_wedge=0.3,
            E_damping=0.199,
            E_heart=0.0005,
            E_caliper=0.0005,
            E_stored=1.5,
        )
    )
    names = {label.split(":")[0]: label for label in legend(figure.axes[0])}
    assert {"electrical", "disc on wedge", "run-out (takes)", "bearings and screws"} <= set(names)
    assert names["rest"].startswith("rest: 0.001 J")  # two losses too small to draw
    assert not any(name.startswith("not accounted") for name in names)
    assert "source" not in names


def test_energy_of_a_rig_comes_from_its_source() -> None:
    figure = energy_balance(energies(E_source=2.0, E_copper=1.5, E_shaft=0.4, E_line=0.1))
    names = {label.split(":")[0] for label in legend(figure.axes[0])}
    assert names == {"source", "copper", "bearings and screws", "damping of screws and sensor"}


def test_one_small_entry_keeps_its_name() -> None:
    figure = energy_balance(energies(E_source=2.0, E_copper=1.999, E_shaft=0.001))
    names = {label.split(":")[0] for label in legend(figure.axes[0])}
    assert names == {"source", "copper", "bearings and screws"}
