"""What the paper measured: Table 4, Figs. 5 to 7 and Table 3's friction, each with its tolerance.

Table 1 and Table 2 are theory and data sheets, and are not among them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bywire.brakes.motorcycle.paper import facts
from bywire.brakes.motorcycle.paper.table4 import step_peak
from bywire.brakes.motorcycle.paper.tolerances import CORNER, GAIN, LOOP, OVERSHOOT, STEADY
from bywire.reproduction.item import Allowance, Fact, reading


@dataclass(frozen=True)
class Statement:
    """A measured number of the paper.

    Parameters
    ----------
    name
        Of the statement; what ``computed`` calls its counterpart.
    fact
        What is stated, and where.
    allowance
        Its tolerance and the reason.
    note
        How the counterpart is computed.
    """

    name: str
    fact: Fact
    allowance: Allowance
    note: str

    @property
    def tolerance(self) -> float:
        """Tolerance in the fact's unit, > 0."""
        return self.allowance.around(self.fact.value)

    def residual(self, computed: float) -> float:
        """Return computed less stated, in units of the tolerance."""
        return (computed - self.fact.value) / self.tolerance


def _label(size: float, unit: str, axis: str) -> Allowance:
    return Allowance(
        f"end of {axis}",
        size,
        unit,
        f"an axis ends at the first label beyond what is drawn, and its labels lie "
        f"{2.0 * size:g} {unit} apart: half of that to either side of the middle",
    )


def _digit(size: float, unit: str, what: str) -> Allowance:
    return Allowance(f"{what} of Table 3", size, unit, "half a unit in the last printed digit")


_DIGITS = {
    "k_brk_p": 0.05,
    "f_cfr_p": 5e-10,
    "c": 0.5,
    "mu_T": 5e-8,
    "f_cfr_n": 5e-11,
    "k_brk_n": 0.05,
}
_CURRENT, _RAMP = (
    _label(0.25, "A", "Fig. 5's current axis"),
    _label(2.5, "bar", "Fig. 5's pressure axis"),
)
_STEP, _BRAKING = (_label(0.25, "bar", "Fig. 6's axis"), _label(2.5, "bar", "Fig. 7a's axis"))
TIME = Allowance("time constants of Table 4", CORNER.size, CORNER.unit, CORNER.reason)


def _table4(region: str) -> tuple[Statement, ...]:
    """Return the row of a region: gain, two time constants, and what the slow pair does."""
    row, model = facts.TABLE4[region], facts.table4_model(region)
    height = facts.FIG6_STEP.value
    _, high = step_peak(model, height)
    where = f"Table 4, {region} pressure"
    times = tuple(
        Statement(
            f"table4.{region}.{key}",
            Fact(
                1e3 / (2.0 * math.pi * row[key].value),
                "ms",
                f"{where}: 1/(2 pi {row[key].value:g} Hz)",
            ),
            TIME,
            "eq. (21) with that gain, fitted to sines of 0.1 A, 1 to 15 Hz",
        )
        for key in ("T1", "T2")
    )
    return (
        Statement(f"table4.{region}.K", row["K"], GAIN, "step of 0.35 A with dither"),
        *times,
        Statement(
            f"table4.{region}.overshoot",
            Fact(100.0 * (high / (height * model.gain) - 1.0), "%", f"{where}, eq. (22)"),
            OVERSHOOT,
            "highest point of the step over its end after 4 s: what the slow pair "
            "does, whose zero and pole have no counterpart of their own",
        ),
    )


STATEMENTS: tuple[Statement, ...] = (
    *(each for region in facts.REGIONS for each in _table4(region)),
    *(
        Statement(f"table3.{name}", fact, _digit(_DIGITS[name], fact.unit, name), "the parameter")
        for name, fact in facts.TABLE3.items()
    ),
    Statement(
        "fig5.p_max",
        reading(32.5, "bar", "Fig. 5: pressure axis ends at 35 bar"),
        _RAMP,
        "highest pressure of the ramp (17), with or without dither",
    ),
    Statement(
        "fig5.i_max",
        reading(5.25, "A", "Fig. 5: current axis ends at 5.5 A"),
        _CURRENT,
        "largest measured current behind the 20 Hz low-pass, with or without dither",
    ),
    Statement(
        "fig5.loop_area_ratio",
        facts.FIG5_LOOP,
        LOOP,
        "area of the loop with dither over that without, averaged over a dither period",
    ),
    Statement(
        "fig6.peak",
        reading(28.75, "bar", "Fig. 6: axis from 25 to 29 bar"),
        _STEP,
        "highest point of the step of 0.35 A from 25 bar, averaged over a dither period",
    ),
    Statement(
        "fig7.peak",
        reading(37.5, "bar", "Fig. 7a: axis ends at 40 bar"),
        _BRAKING,
        "highest point of hard braking, averaged over a dither period; gains tuned on Table "
        "4's medium model, because the paper's are not printed",
    ),
    Statement(
        "fig7.steady_state_error",
        facts.STEADY_STATE,
        STEADY,
        "mean of the last 0.24 s of hard braking less 37 bar",
    ),
)
"""every misfit term: (computed - stated)/tolerance"""


def allowances() -> tuple[Allowance, ...]:
    """Return the tolerances in use, each once."""
    return tuple(dict.fromkeys(statement.allowance for statement in STATEMENTS))
