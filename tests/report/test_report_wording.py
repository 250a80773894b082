"""Units and amounts as written in print."""

from __future__ import annotations

import re

import pytest

from bywire.report.style import axis_label
from bywire.report.wording import (
    amount,
    clean,
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
        (0.06, "s", None, "60 ms"),
        (2e6, "Pa", 0.0, "20 bar"),
    ],
)
def test_a_figure_of_many_values_has_the_unit_of_the_largest(
    value: float, symbol: str, like: float | None, written: str
) -> None:
    assert amount(value, symbol, like=like) == written
    if like is not None:
        assert written.split()[1] in re.split(", | or ", readable_units(symbol))


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


def test_text_keeps_letters_of_all_scripts_and_loses_what_steers() -> None:
    assert clean("Δp 圧力\u00a0é\nnext") == "Δp 圧力 é\nnext"
    assert clean("\x1b\x00\u202e\ud800") == "\N{REPLACEMENT CHARACTER}" * 4


@pytest.mark.parametrize(
    ("value", "symbol", "written"),
    [
        (12654.0, "1", "12654"),
        (12500.0, "N", "12.5 kN"),
        (999.0, "N", "999 N"),
        (8.889e8, "J", "888.9 MJ"),
        (105200.0, "J", "105.2 kJ"),
        (1500.0, "W", "1.5 kW"),
        (1.98e-7, "m", "0.198 µm"),
        (2e-4, "m", "0.2 mm"),
        (50.0, "Pa", "50 Pa"),
        (0.9999999, "s", "1 s"),
    ],
)
def test_units_follow_the_size_and_counts_are_whole(
    value: float, symbol: str, written: str
) -> None:
    assert amount(value, symbol) == written


@pytest.mark.parametrize(
    ("value", "symbol", "error", "written", "shown_error"),
    [
        (701.65, "K", 7e-9, "428.5 °C", "< 0.1 K"),
        (60.0, "m", 1e-7, "60 m", "< 0.01 m"),
        (0.0, "s", 6e-11, "0 ms", "< 0.001 ms"),
        (5e-7, "J", 7e-7, "0 J", "< 0.001 J"),
        (90.68, "%", 0.2, "90.7 %", "0.2 percentage points"),
    ],
)
def test_digits_without_meaning_are_left_out(
    value: float, symbol: str, error: float, written: str, shown_error: str
) -> None:
    assert measured_amount(value, symbol, error) == written
    assert error_text(value, symbol, error) == shown_error
