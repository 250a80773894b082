"""Whether a sine leaves the range of a brake, and what is said of a response."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.analysis.loop import LOOPS
from bywire.analysis.response.large_signal import leaving
from bywire.api.frequency_response import purity
from bywire.api.frequency_response import response_warnings as warnings
from bywire.core.catalog import main_set, parameters


@pytest.mark.parametrize(
    ("name", "value", "amplitude", "text"),
    [
        ("pressure", 20e5, 3e5, ""),
        ("pressure", 20e5, 21e5, "-1 bar"),
        ("pressure", 40e5, 20e5, "end stop"),
        ("moment", 200.0, 20.0, ""),
        ("moment", 200.0, 250.0, "must be > 0 N*m"),
        ("moment", 200.0, 1e4, "must be > 0 N*m"),
        ("position", 0.0, 1.0, ""),
    ],
)
def test_a_sine_beyond_the_range_has_a_reason(name, value, amplitude, text) -> None:
    loop = LOOPS.find(name)
    found = leaving(loop, parameters(main_set(loop.assembly)), value, amplitude)
    assert text in found
    assert bool(found) == bool(text)


def response(settled: list[float], scatter: list[float]) -> xr.Dataset:
    dims, shape = ("variant", "amplitude", "frequency"), (1, 1, len(settled))
    ones = {"gain": 1.0, "coherence": 0.25, "unsettled_substeps": 0.0}
    data = {name: (dims, np.full(shape, value)) for name, value in ones.items()}
    data |= {
        "settled": (dims, np.reshape(settled, shape)),
        "scatter": (dims, np.reshape(scatter, shape)),
    }
    return xr.Dataset(data, {"amplitude": [1e4]}, {"excitation": "sine"})


def test_what_never_repeats_is_counted_and_measured() -> None:
    (text,) = warnings(response([1.0, 0.0], [0.0, 1.7]), (), "Pa", 1e-3)
    assert "within 0.1 % at 1 frequency (" in text
    assert "up to 170 %" in text
    (text,) = warnings(response([0.0, 0.0], [0.01, 0.02]), (), "Pa", 1e-3)
    assert "at 2 frequencies (" in text
    assert warnings(response([1.0, 1.0], [0.0, 0.0]), (), "Pa", 1e-3) == []


def test_power_beside_a_sine_is_no_lack_of_coherence() -> None:
    found = response([1.0], [0.0])
    assert "output power at the sine's frequency: 0.250" in purity(found)
    assert "coherence" in purity(found.assign_attrs(excitation="multisine"))
