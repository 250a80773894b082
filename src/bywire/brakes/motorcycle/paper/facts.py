"""What Dardanelli, Alli, Savaresi (2010) print: tables, axes of figures, requirements.

Only captions and axis ranges of the figures are used; nothing is read off curves.
"""

from __future__ import annotations

from collections.abc import Mapping

from bywire.brakes.motorcycle.linear.rational import Rational, first_orders
from bywire.brakes.motorcycle.sets.dardanelli2010 import SOURCE
from bywire.reproduction.item import Fact

CITATION = SOURCE


def _table(where: str, rows: Mapping[str, tuple[float, str]]) -> dict[str, Fact]:
    return {name: Fact(value, unit, where) for name, (value, unit) in rows.items()}


TABLE1 = _table(
    "Table 1",
    {
        "beta": (1e9, "Pa"),
        "nu": (5e-4, "m**2/s"),
        "k_damp": (2e4, "N*s/m"),
        "rho": (1e3, "kg/m**3"),
        "d_pl": (8.0, "mm"),
        "L_pl": (1.0, "m"),
        "A_mc": (120.0, "mm**2"),
        "x_mc": (7.0, "mm"),
        "A_pd": (300.0, "mm**2"),
        "K_pd": (1e6, "N/m"),
        "k_g": (3e-4, "m/rad"),
        "eta_g": (0.9, "1"),
        "J_mot": (1e-5, "kg*m**2"),
        "K_e": (30.4e-3, "Wb"),
        "M_mc": (1e-2, "kg"),
    },
)

TABLE2 = _table(
    "Table 2",
    {
        "K": (10.1, "bar/A"),
        "zero": (160.0, "Hz"),
        "pole1": (0.866, "Hz"),
        "pole2": (9.75, "Hz"),
        "pole3": (4.7e4, "Hz"),
    },
)

TABLE3 = _table(
    "Table 3",
    {
        "k_brk_p": (2.6, "1"),
        "f_cfr_p": (1.6e-8, "N*m/Pa"),
        "c": (5.0, "s/rad"),
        "mu_T": (2e-7, "N*m*s/rad"),
        "f_cfr_n": (5.4e-9, "N*m/Pa"),
        "k_brk_n": (2.3, "1"),
    },
)

_UNITS4 = {"K": "bar/A", "zero": "Hz", "T1": "Hz", "T2": "Hz", "T_L": "Hz"}
TABLE4 = {
    region: _table(
        f"Table 4, {region} pressure",
        {name: (value, unit) for value, (name, unit) in zip(row, _UNITS4.items(), strict=True)},
    )
    for region, row in {
        "low": (10.0, 0.095, 1.15, 6.78, 0.104),
        "medium": (10.2, 0.096, 1.25, 7.15, 0.104),
        "high": (10.5, 0.085, 1.36, 8.27, 0.095),
    }.items()
}
"""corner frequencies 1/(2 pi tau); regions p < 10 bar, 10 to 35 bar, above 35 bar (section 5)"""

REGIONS = {"low": 5e5, "medium": 25e5, "high": 37e5}
"""a pressure [Pa] inside each region, ours; 25 bar is where Fig. 6 begins"""

RE_LAMINAR = Fact(2000.0, "1", "section 3.3, assumption (2)")
EQ11 = Fact(1.0, "1", "section 3.3: much greater than 1")
MU_TEXT = Fact(1e-2, "N*s/rad", "section 3.4, printed as N/m**2")
SENSOR_RANGE = Fact(50.0, "bar", "section 2: range of the pressure sensor")
K_LF = Fact(32.0, "1", "eq. (12)")

FIG3_STEP = Fact(0.73, "A", "Fig. 3, caption")
FIG3_TOP = Fact(0.9, "A", "axis limit: top of Fig. 3", "axis")
FIG3_BANDWIDTH = Fact(100.0, "Hz", "section 3.1")
FIG4_TOP = Fact(0.15, "N*m", "axis limit: top tick of Fig. 4", "axis")
FIG4_BOTTOM = Fact(-0.1, "N*m", "axis limit: bottom tick of Fig. 4", "axis")
FIG5_TOP = Fact(35.0, "bar", "axis limit: end of Fig. 5's pressure axis", "axis")
FIG5_CURRENT = Fact(5.5, "A", "axis limit: top of Fig. 5's current axis", "axis")
FIG5_LOOP = Fact(0.0, "%", "section 4.2: hysteresis totally removed")
FIG5_REMOVED = Fact(0.0, "bar", "section 4.2: hysteresis totally removed")
RAMP_PEAK = Fact(5.0, "A", "eq. (17)")
FIG6_START = Fact(25.0, "bar", "axis limit: bottom of Fig. 6", "axis")
FIG6_TOP = Fact(29.0, "bar", "axis limit: top of Fig. 6", "axis")
FIG6_STEP = Fact(0.35, "A", "Fig. 6, caption")

BANDWIDTH = Fact(10.0, "Hz", "section 6, requirement", "requirement")
PHASE_MARGIN = Fact(60.0, "deg", "section 6, requirement", "requirement")
OVERSHOOT = Fact(15.0, "%", "section 6, requirement", "requirement")
STEADY_STATE = Fact(0.0, "bar", "section 6, requirement", "requirement")


def table2_model() -> Rational:
    """Return the transfer function that Table 2 prints [Pa/A]."""
    return first_orders(
        "Table 2 as printed",
        TABLE2["K"].value * 1e5,
        (TABLE2["zero"].value,),
        tuple(TABLE2[name].value for name in ("pole1", "pole2", "pole3")),
    )


def table4_model(region: str) -> Rational:
    """Return eq. (22) with the values of Table 4 [Pa/A]."""
    row = TABLE4[region]
    return first_orders(
        f"Table 4, {region} pressure",
        row["K"].value * 1e5,
        (row["zero"].value,),
        tuple(row[name].value for name in ("T1", "T2", "T_L")),
    )
