"""All units of the list, and all products and quotients of two, versus handwritten factors."""

from __future__ import annotations

import itertools
import math
import re

import pytest

from bywire.core import unit_list, units
from bywire.core.errors import UnitError
from bywire.core.unit_list import scale_of, spellings

PI = math.pi
INCH, FOOT, POUND, GRAVITY = 0.0254, 0.3048, 0.45359237, 9.80665
GALLON = 231 * INCH**3
# Exponents of kg, m, s, A, K, mol, cd, rad; then what each unit is in SI, written out by hand.
BY_HAND = {
    (0, 1, 0, 0, 0, 0, 0, 0): {
        1e-9: "nm",
        1e-6: "um µm micron",
        1e-3: "mm",
        1e-2: "cm",
        1e-1: "dm",
        1.0: "m meter metre",
        1e3: "km",
        INCH: "in inch Inch inches",
        FOOT: "ft foot feet",
        3 * FOOT: "yd yard",
        5280 * FOOT: "mi mile",
    },
    (0, 0, 1, 0, 0, 0, 0, 0): {
        1e-9: "ns nsec",
        1e-6: "us µs usec µsec",
        1e-3: "ms msec mSec",
        1.0: "s sec Sec Sek Sekunde",
        60.0: "min Min mins Minuten minute",
        3600.0: "h hr hrs Std Stunden hour",
        86400.0: "d day",
    },
    (0, 0, 0, 1, 0, 0, 0, 0): {
        1e-9: "nA",
        1e-6: "uA µA",
        1e-3: "mA mAmp mAmps",
        1.0: "A Amp amp Amps amps ampere Adc",
        1e3: "kA",
    },
    (1, 2, -3, -1, 0, 0, 0, 0): {
        1e-9: "nV",
        1e-6: "uV µV",
        1e-3: "mV millivolt",
        1.0: "V volt Volt Volts Vdc VDC",
        1e3: "kV",
        1e6: "MV",
    },
    (1, 2, -3, -2, 0, 0, 0, 0): {
        1e-6: "uohm µΩ",
        1e-3: "mohm mOhm mΩ",
        1.0: "ohm Ohm ohms OHM Ω",
        1e3: "kohm kOhm kΩ",
        1e6: "Mohm MOhm MΩ",
        1e9: "GΩ",
    },
    (-1, -2, 3, 2, 0, 0, 0, 0): {1e-6: "uS µS", 1e-3: "mS", 1.0: "S siemens"},
    (1, 2, -3, 0, 0, 0, 0, 0): {
        1e-9: "nW",
        1e-6: "uW µW",
        1e-3: "mW",
        1.0: "W VA watt",
        1e3: "kW kVA kilowatt",
        1e6: "MW",
        1e9: "GW",
        75 * GRAVITY: "PS",
        550 * FOOT * POUND * GRAVITY: "hp HP horsepower",
    },
    (1, 2, -2, 0, 0, 0, 0, 0): {
        1e-9: "nJ",
        1e-6: "uNm µNm uJ µJ",
        1e-3: "mJ mNm mWs Nmm",
        1e-2: "cNm Ncm",
        1.0: "J Ws joule Nm N-m",
        1e3: "kJ kNm kWs",
        1e6: "MJ MNm",
        1e9: "GJ",
        3.6: "mWh",
        3600.0: "Wh",
        3.6e6: "kWh",
        3.6e9: "MWh",
        4.184: "cal",
        4184.0: "kcal",
        GRAVITY: "kgfm kpm kgf-m",
        FOOT * POUND * GRAVITY: "ft-lb lb-ft ft-lbf lbf-ft ftlb lbft",
        INCH * POUND * GRAVITY: "in-lb lb-in in-lbf lbf-in inlb lbin",
    },
    (1, 1, -2, 0, 0, 0, 0, 0): {
        1e-9: "nN",
        1e-6: "uN µN",
        1e-3: "mN",
        1e-2: "cN",
        1.0: "N newton Newton",
        10.0: "daN",
        1e3: "kN",
        1e6: "MN",
        1e9: "GN",
        GRAVITY: "kgf kp kilopond",
        POUND * GRAVITY: "lbf",
        1e3 * POUND * GRAVITY: "klbf",
    },
    (1, 1, -1, 0, 0, 0, 0, 0): {1e-6: "uNs", 1e-3: "mNs", 1.0: "Ns", 1e3: "kNs"},
    (1, 2, -1, 0, 0, 0, 0, 0): {1e-6: "uNms", 1e-3: "mNms", 1.0: "Nms", 1e3: "kNms"},
    (1, -1, -2, 0, 0, 0, 0, 0): {
        1e-9: "nPa",
        1e-6: "uPa µPa",
        1e-3: "mPa",
        1e-1: "ubar µbar",
        1.0: "Pa pascal",
        1e2: "hPa mbar",
        1e3: "kPa",
        1e5: "bar Bar BAR bar(g) barg bar(a) bara",
        1e6: "MPa",
        1e8: "kbar",
        1e9: "GPa",
        POUND * GRAVITY / INCH**2: "psi PSI psig psia",
        1e3 * POUND * GRAVITY / INCH**2: "kpsi ksi",
        101325.0: "atm",
        101325.0 / 760.0: "Torr torr",
        0.101325 / 0.76: "mTorr",
        13595.1 * GRAVITY * 1e-3: "mmHg",
        13595.1 * GRAVITY * INCH: "inHg",
        1000 * GRAVITY: "mH2O mWS",
        10 * GRAVITY: "cmH2O",
        GRAVITY: "mmH2O mmWS",
        1000 * GRAVITY * INCH: "inH2O",
    },
    (1, -1, -1, 0, 0, 0, 0, 0): {1e-6: "uPas", 1e-3: "mPas cP cPs", 1e-1: "Poise", 1.0: "Pas"},
    (1, 0, 0, 0, 0, 0, 0, 0): {
        1e-9: "microgram",
        1e-6: "milligram",
        1e-3: "gram grams Gramm",
        1.0: "kg Kg KG kilogram",
        1e3: "tonne",
        POUND: "lb lbs lbm pound",
        POUND / 16: "oz ounce",
    },
    (0, 0, 0, 0, 1, 0, 0, 0): {
        1e-3: "mK",
        1.0: "K kelvin degK °K delta_degC degC °C",
        5.0 / 9.0: "delta_degF degF °F",
    },
    (0, 0, -1, 0, 0, 0, 0, 0): {
        1e-3: "mHz",
        1.0: "Hz hz HZ hertz",
        1e3: "kHz",
        1e6: "MHz",
        1e9: "GHz",
    },
    (0, 0, 0, 0, 0, 0, 0, 1): {
        1e-6: "urad µrad",
        1e-3: "mrad",
        1.0: "rad radian",
        PI / 180: "deg Deg DEG ° Grad degree",
        PI / 200: "gon",
        PI / 180 / 60: "arcmin",
        PI / 180 / 3600: "arcsec",
        2 * PI: "rev revs turn revolution Umdr Umdrehungen",
    },
    (0, 0, -1, 0, 0, 0, 0, 1): {
        PI / 30: "rpm RPM Upm U/min",
        1e3 * PI / 30: "krpm",
        2 * PI: "rps U/s",
    },
    (0, 1, -1, 0, 0, 0, 0, 0): {
        1 / 3.6: "kph km/h kmh KPH",
        5280 * FOOT / 3600: "mph MPH",
        1852 / 3600: "knot kt kts",
    },
    (0, 1, -2, 0, 0, 0, 0, 0): {GRAVITY: "g_n g0", 1e-3 * GRAVITY: "mg_n mg0"},
    (0, 3, 0, 0, 0, 0, 0, 0): {
        1e-9: "ul µl uL",
        1e-6: "ml mL cc ccm milliliter",
        1e-5: "cl",
        1e-4: "dl",
        1e-3: "l L liter ltr",
        GALLON: "gal gallon",
    },
    (0, 3, -1, 0, 0, 0, 0, 0): {1e-3 / 60: "lpm l/min L/min", GALLON / 60: "gpm GPM"},
    (0, 2, -1, 0, 0, 0, 0, 0): {1e-6: "cSt", 1e-4: "St"},
    (0, 0, 1, 1, 0, 0, 0, 0): {
        1e-6: "uAs µAs",
        1e-3: "mAs",
        1.0: "coulomb As",
        3.6: "mAh",
        3600.0: "Ah",
        3.6e6: "kAh",
    },
    (-1, -2, 4, 2, 0, 0, 0, 0): {1e-12: "pF", 1e-9: "nF", 1e-6: "uF µF", 1e-3: "mF", 1.0: "farad"},
    (1, 2, -2, -2, 0, 0, 0, 0): {1e-9: "nH", 1e-6: "uH µH", 1e-3: "mH", 1.0: "H henry"},
    (1, 2, -2, -1, 0, 0, 0, 0): {1e-6: "uWb", 1e-3: "mWb mVs", 1.0: "Wb Vs weber"},
    (1, 0, -2, -1, 0, 0, 0, 0): {
        1e-9: "nT",
        1e-7: "mGauss",
        1e-6: "uT",
        1e-4: "Gauss",
        1e-3: "mT",
        1.0: "T tesla",
    },
    (0, 0, 0, 0, 0, 1, 0, 0): {1e-3: "mmol", 1.0: "mol"},
    (0, 0, 0, 0, 0, 0, 1, 0): {1.0: "cd candela"},
    (0, 0, 0, 0, 0, 0, 0, 0): {
        1.0: "1 unitless bool boolean count counts strain",
        1e-2: "% percent pct Prozent",
        1e-3: "‰",
        1e-6: "ppm ustrain microstrain µε",
    },
}
LISTED = [
    (name, factor, powers)
    for powers, by_factor in BY_HAND.items()
    for factor, names in by_factor.items()
    for name in names.split()
]
FIRST = [  # of each factor and dimension one, and those in degrees as differences
    (names.split()[0], factor, powers)
    for powers, by_factor in BY_HAND.items()
    for factor, names in by_factor.items()
    if names.split()[0] != "1"
]
PLACES = {"degC": 273.15, "°C": 273.15, "degF": 459.67 / 1.8, "°F": 459.67 / 1.8}


def test_every_unit_has_its_factor():
    for name, factor, powers in LISTED:
        scale = scale_of(name)
        assert scale.factor == pytest.approx(factor, rel=1e-9), name
        assert scale.powers == powers, name
        assert scale.zero == pytest.approx(PLACES.get(name, 0.0)), name
        assert scale_of(scale.symbol).powers == powers, name
        assert scale_of(scale.symbol).factor == 1.0, name


def test_no_spelling_of_the_list_is_left_out_above():
    """Further spellings of a word have the factor of that word, or of the spelling beside it."""
    factors = {scale_of(name) for name, *_ in LISTED}
    strange = [
        name
        for name in spellings()
        if name not in unit_list._TWO_MEANINGS and scale_of(name) not in factors
    ]
    words = [
        n
        for n in strange
        if not re.fullmatch(
            r"(?i)(pico|nano|micro|milli|centi|deci|deca|"
            r"hecto|kilo|mega|giga)\w+",
            n,
        )
    ]
    assert [n for n in words if not scale_of(n).reference] == []


def test_all_products_and_quotients_of_two_units():
    for (i, (a, by_a, of_a)), (k, (b, by_b, of_b)) in itertools.product(enumerate(FIRST), repeat=2):
        below = f"({b})" if "/" in b else b
        both = [(f"{a}/{below}", by_a / by_b, -1)] + [(f"{a}*{b}", by_a * by_b, 1)] * (i <= k)
        for text, factor, sign in both:
            scale = scale_of(text)
            assert math.isclose(scale.factor, factor, rel_tol=1e-9), text
            assert scale.powers == tuple(p + sign * q for p, q in zip(of_a, of_b, strict=True)), (
                text
            )


@pytest.mark.parametrize(
    ("text", "factor", "symbol"),
    [
        ("mV/Nm", 1e-3, "V/(N*m)"),
        ("1/Nm", 1.0, "1/(N*m)"),
        ("Nm/rad", 1.0, "N*m/rad"),
        ("N m", 1.0, "N*m"),
        ("Pa·s", 1.0, "Pa*s"),
        ("m/s²", 1.0, "m/s**2"),
        ("m/s2", 1.0, "m/s**2"),
        ("s⁻¹", 1.0, "1/s"),
        ("min^-1", 1 / 60, "1/s"),
        ("m^(-1)", 1.0, "1/m"),
        ("1/min", 1 / 60, "1/s"),
        ("W/m^2/K", 1.0, "W/(m**2*K)"),
        ("(m/s)^2", 1.0, "m**2/s**2"),
        ("deg C/min", 1 / 60, "K/s"),
        ("W/degF", 1.8, "W/K"),
        ("N-m/A", 1.0, "N*m/A"),
        ("cm³/U", 1e-6 / (2 * PI), "m**3/rad"),
        ("V/Hz**0.5", 1.0, "V/Hz**0.5"),
        ("bar a/s", 1e5, "Pa/s"),
        ("kN·mm", 1.0, "N*m"),
    ],
)
def test_products_as_people_write_them(text, factor, symbol):
    scale = scale_of(text)
    assert (scale.factor, scale.symbol) == (pytest.approx(factor, rel=1e-12), symbol)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("ma", "is not known .the nearest is 'mA'"),
        ("k N", "the nearest is 'kN'"),
        ("grad", "the nearest is 'Grad'"),
        ("NM", "the nearest is 'Nm' or 'nm'|'nm' or 'Nm'"),
        ("U", "is not known"),
        ("Nm/foo", "'foo' in 'Nm/foo' is not known"),
        ("tex", "is not known"),
        ("g", "ambiguous. Use 'gram' or 'g_n'"),
        ("C", "'coulomb' or 'degC'"),
        ("C/s", "'coulomb' or 'degC'"),
        ("F", "'farad' or 'degF'"),
        ("mV/g", "'gram' or 'g_n'"),
        ("dB", "logarithmic"),
        ("dBm", "logarithmic"),
        ("dB(A)", "logarithmic"),
        ("dB/s", "logarithmic"),
        ("J/kg*K", "ambiguous"),
        ("J/kg K", "ambiguous"),
        ("", "form of a unit"),
        ("m*", "form of a unit"),
        ("(m", "form of a unit"),
        ("m**9**9", "form of a unit"),
        ("m2s", "form of a unit"),
        ("m" * 200, "longer"),
        ("m^9" + "*m^9" * 14, "too large an exponent"),
    ],
)
def test_what_is_no_unit_is_refused_with_the_reason(text, why):
    with pytest.raises(UnitError, match=why):
        scale_of(text)


@pytest.mark.parametrize(
    ("text", "symbol", "value"),
    [
        ("150 g", "kg", 0.15),
        ("0.85 g/cm^3", "kg/m**3", 850.0),
        ("2 g", "m/s**2", 2 * GRAVITY),
        ("20 C", "K", 293.15),
        ("2 C", "A*s", 2.0),
        ("50 F", "K", (50 + 459.67) / 1.8),
        ("50 degF", "K", (50 + 459.67) / 1.8),
        ("2 W/degC", "W/K", 2.0),
        ("9 K", "delta_degC", 9.0),
        ("2 bar(g)", "Pa", 2e5),
        ("3 mA", "A", 3e-3),
    ],
)
def test_the_quantity_that_is_wanted_tells_two_meanings_apart(text, symbol, value):
    assert units.parse(text, symbol, "x") == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "symbol", "why"),
    [
        ("3 ma", "ohm", "the unit 'ma' is not known .the nearest is 'mA'"),
        ("6 dB", "1", "logarithmic"),
        ("2 bar(a)", "Pa", "absolute or relative to ambient"),
        ("20 C", "delta_degC", "wrong unit"),
        ("20 degF", "delta_degC", "wrong unit"),
        ("600 U/min", "Hz", "wrong unit"),
    ],
)
def test_quantities_that_are_refused(text, symbol, why):
    with pytest.raises(UnitError, match=why):
        units.parse(text, symbol, "motor.x")
