"""Units of columns: titles, conversion to SI, and the SI unit that a signal gets."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.core.errors import UnitError
from bywire.data import column_units
from bywire.data.measurement import read_measurement


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("p_mc [bar]", ("p_mc", "bar")),
        ("p (bar(g))", ("p", "bar(g)")),
        ("p [bar(a)]", ("p", "bar(a)")),
        ("v (front) [km/h]", ("v (front)", "km/h")),
        ("pedal", ("pedal", "")),
        ("a]", ("a]", "")),
    ],
)
def test_a_title_has_its_unit_in_the_last_brackets(title, parts):
    assert column_units.split_title(title) == parts


@pytest.mark.parametrize(
    ("title", "number", "value", "symbol"),
    [
        ("k [Nm/A]", 0.03, 0.03, "N*m/A"),
        ("a [mV/Nm]", 2.0, 2e-3, "V/(N*m)"),
        ("b [1/Nm]", 2.0, 2.0, "1/(N*m)"),
        ("c [Nms]", 1.0, 1.0, "N*m*s"),
        ("phi [Grad]", 90.0, np.pi / 2, "rad"),
        ("n [U/min]", 600.0, 20 * np.pi, "rad/s"),
        ("T [deg C]", 20.0, 293.15, "K"),
        ("T [degF]", 68.0, 293.15, "K"),
        ("d [Min]", 5.0, 300.0, "s"),
        ("P [PS]", 1.0, 735.49875, "W"),
        ("i [amps]", 1.0, 1.0, "A"),
        ("p [bar(g)]", 1.0, 1e5, "Pa"),
        ("a [m/s²]", 1.0, 1.0, "m/s**2"),
        ("R [Ohm]", 1.0, 1.0, "ohm"),
        ("U [Volt]", 1.0, 1.0, "V"),
        ("dT [°C/s]", 1.0, 1.0, "K/s"),
        ("x [-]", 1.0, 1.0, "1"),
    ],
)
def test_a_column_is_converted_to_its_si_unit(tmp_path, title, number, value, symbol):
    path = tmp_path / "a.csv"
    path.write_text(f"t [Sec];{title}\n0;{number}\n1;{number}\n", encoding="utf-8")
    (signal,) = read_measurement(path).data_vars.values()
    assert signal.attrs["units"] == symbol
    np.testing.assert_allclose(signal, value, rtol=1e-14)


@pytest.mark.parametrize(
    "unit", ["ma", "k N", "dB", "dBm", "tex", "g", "C", "J/kg*K", "grad", "Nm/foo"]
)
def test_a_column_of_another_unit_is_refused_with_the_unit(tmp_path, unit):
    path = tmp_path / "a.csv"
    path.write_text(f"t [s],x [{unit}]\n0,1\n1,2\n")
    with pytest.raises(UnitError, match=r"column 'x': the unit .*Specify the unit in a mapping"):
        read_measurement(path)
