"""Statements in the sources, and sentences interpreted as numbers."""

from __future__ import annotations

from bywire.authoring import Fact

_ABSTRACT = "Line, Manzie, Good (2008), abstract"
LIMITED = "standard cascaded PI control has limited performance under nonlinear stiffness"

UNEVEN = Fact(
    1.5,
    "1",
    f"{_ABSTRACT}: {LIMITED}; read as: steps of 0.5 kN take 1.5 times as long at 1 kN as at 19 kN",
    "reading",
)
IMPROVED = Fact(
    1.0,
    "1",
    f"{_ABSTRACT}: gain scheduling is an improvement; read as: it makes small steps differ less",
    "reading",
)
STICKS = Fact(
    1.0,
    "1",
    f"{_ABSTRACT}: load-dependent friction; read as: applying needs more current than releasing, "
    "and the difference increases with load",
    "reading",
)
SATURATES = Fact(
    95.0,
    "%",
    f"{_ABSTRACT}: actuator saturation; read as: large steps reach the current limit",
    "reading",
)

_BENCHMARK = "Strathmann, Oehlerking (2015), as in the ARCH-COMP model"
POLE = Fact(-504.0, "1/s", f"{_BENCHMARK}: middle of the interval of the current coefficient")
TOUCH = Fact(0.05, "dm", f"{_BENCHMARK}: x stays below x0 up to 0.1 s", "requirement")
