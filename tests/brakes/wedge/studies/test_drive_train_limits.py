"""A study names what limits a drive train, with numbers, and rejects keys without effect."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.brakes.wedge.studies.drive_train import DEFAULTS, active, around, failures
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.synthesis.study import STUDIES

MU = (0.25, 0.45)


def designs(**changes: float) -> xr.Dataset:
    """Return three slopes and three leads, of which only the middle slope is good."""
    shape = (3, 3, 2)
    power = np.full(shape, 80.0)
    power[1, 1] = (70.0, 60.0)
    cube = {
        "filtered": power,
        "t_90": np.full(shape, 0.08),
        "current": np.full(shape, 12.0),
        "held": np.full(shape, 950.0),
        "left": np.zeros(shape),
        "stop": np.zeros(shape),
    }
    cube["t_90"][0, 1, 1] = 0.12
    cube["stop"][1, 2, 0] = 30.0
    for name, value in changes.items():
        cube[name][1, 1, 1] = value
    dims = ("tan_alpha", "lead", "mu_B")
    found = xr.Dataset(
        {name: (dims, value) for name, value in cube.items()},
        coords={"tan_alpha": [0.28, 0.3, 0.32], "lead": [3e-3, 3.5e-3, 4e-3], "mu_B": list(MU)},
    )
    found["lateness"] = found["t_90"].max("mu_B") / DEFAULTS.t_90
    found["worst_filtered"] = found["filtered"].max("mu_B")
    return found


def middle(data: xr.Dataset) -> xr.Dataset:
    return data.isel(tan_alpha=1, lead=1)


def test_nothing_but_power_limits_a_design_with_room():
    texts = active(middle(designs()), parameters("roberts2003"), DEFAULTS)
    assert texts == ["power: 70 W at mu_B = 0.25"]


def test_each_limit_that_is_reached_is_named():
    par = parameters("roberts2003")
    at = middle(designs(t_90=0.1, current=par.control.position.i_max, held=905.0, left=47.4))
    texts = active(at, par, DEFAULTS)
    assert [text.partition(":")[0] for text in texts] == [
        "time",
        "current",
        "hold",
        "release",
        "power",
    ]
    assert texts[0].count("100 ms") == 2
    assert "mu_B = 0.45" in texts[0]
    assert "control.position.i_max = 20 A with mu_B = 0.45" in texts[1]


def test_neighbors_say_why_they_are_worse():
    data = designs()
    texts = around([data], middle(data), DEFAULTS)
    assert texts[0] == "flatter wedge, tan(alpha) = 0.28: infeasible: late, 120 ms at mu_B = 0.45"
    assert texts[1].endswith("+14 % power, at mu_B = 0.25")
    assert texts[3] == "longer lead, lead = 4 mm: infeasible: presses on an end stop"
    edge = data.isel(tan_alpha=slice(1, 3))
    assert len(around([edge], edge.isel(tan_alpha=0, lead=1), DEFAULTS)) == 3


def test_what_never_gets_there_is_not_late():
    assert failures(middle(designs(t_90=np.nan)), DEFAULTS) == ["never reaches 90 % of the demand"]


@pytest.mark.parametrize(
    ("study", "name", "text"),
    [
        ("drive-train", "wedge.mu_B", "option mu_B"),
        ("drive-train", "rig.F_0", "rigs"),
        ("actuator-sizing", "drive.mode", "pressures"),
    ],
)
def test_keys_without_effect_are_refused(study, name, text):
    with pytest.raises(ParameterError, match=text):
        STUDIES.find(study).require_effect([name])
    STUDIES.find(study).require_effect(["motor_1.R_ref"])


def test_every_ruled_key_exists():
    for name, base in (("drive-train", "roberts2003"), ("actuator-sizing", "dardanelli2010")):
        known = parameters(base).flat()
        for key in STUDIES.find(name).ruled:
            assert any(one == key or one.startswith(f"{key}.") for one in known), key
