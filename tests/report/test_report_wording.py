"""Units and amounts as people write them."""

from __future__ import annotations

import pytest

from bywire.report.style import axis_label
from bywire.report.wording import (
    amount,
    clean,
    duration,
    error_text,
    measured_amount,
    readable_units,
    unit_text,
)


@pytest.mark.parametrize(
    ("symbol", "written"),
    [
        ("1", ""),
        ("kg*m**2/rad**2", "kg·m²/rad²"),
        ("m**3/(s*Pa)", "m³/(s·Pa)"),
        ("ohm", "Ω"),
        ("s**-1", "s⁻¹"),
        ("percent", "%"),
    ],
)
def test_units_are_written_as_in_print(symbol: str, written: str) -> None:
    assert unit_text(symbol) == written


@pytest.mark.parametrize(
    ("value", "symbol", "written"),
    [
        (2e6, "Pa", "20 bar"),
        (0.0070001, "m", "7 mm"),
        (0.0, "1", "0"),
        (None, "A", "-"),
        (float("nan"), "A", "not defined"),
        (float("inf"), "s", "inf s"),
        (12.345678, "A", "12.35 A"),
    ],
)
def test_amounts_are_in_display_units(value: float | None, symbol: str, written: str) -> None:
    assert amount(value, symbol) == written


@pytest.mark.parametrize(
    ("value", "symbol", "like", "written"),
    [
        (0.9, "m", 41.0, "0.9 m"),
        (0.9, "m", 0.9, "900 mm"),
        (0.06, "s", 0.09, "60 ms"),
        (0.06, "s", 1.2, "0.06 s"),
        (0.06, "s", None, "0.06 s"),
        (2e6, "Pa", 0.0, "20 bar"),
    ],
)
def test_a_figure_of_many_values_has_the_unit_of_the_largest(
    value: float, symbol: str, like: float | None, written: str
) -> None:
    assert amount(value, symbol, like=like) == written
    if like is not None:
        assert written.split()[1] in readable_units(symbol).split(" or ")


def test_axis_labels_name_quantity_and_unit() -> None:
    assert axis_label("motor current", "A") == "motor current [A]"
    assert axis_label("piston travel", "m") == "piston travel [mm]"
    assert axis_label("cost in $", "1") == r"cost in \$ [-]"


def test_temperatures_are_in_degrees_celsius_and_their_errors_in_kelvin() -> None:
    assert amount(623.15, "K") == "350 °C"
    assert (amount(20.0, "delta_degC"), amount(-5.0, "delta_degC")) == ("20 K", "-5 K")
    assert measured_amount(623.27, "K", 0.2) == "350.1 °C"
    assert error_text(623.15, "K", 0.2) == "0.2 K"
    assert axis_label("front discs", "K") == "front discs [°C]"


def test_durations_choose_their_unit() -> None:
    assert (duration(0.0423817), duration(60.0)) == ("42.4 ms", "60 s")


def test_text_keeps_letters_of_all_scripts_and_loses_what_steers() -> None:
    assert clean("Δp 圧力\u00a0é\nnext") == "Δp 圧力 é\nnext"
    assert clean("\x1b\x00\u202e\ud800") == "\N{REPLACEMENT CHARACTER}" * 4
