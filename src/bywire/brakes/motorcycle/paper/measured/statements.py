"""What the paper measured: Table 4, Figs. 5 to 7 and Table 3's friction, each with its tolerance.

Table 1 and Table 2 are theory and data sheets, and are not among them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from bywire.brakes.motorcycle.paper.facts import ALLOWANCES, FACTS, REGIONS, table4_model
from bywire.brakes.motorcycle.paper.table4 import step_peak
from bywire.reproduction.item import Allowance, Fact
from bywire.reproduction.source_file import SourceFile


@dataclass(frozen=True)
class Statement:
    """A measured number of the paper.

    Parameters
    ----------
    name
        Of the statement; what ``computed`` calls its counterpart.
    fact
        What is stated, and where, with its tolerance and how the counterpart is computed.
    """

    name: str
    fact: Fact

    @property
    def allowance(self) -> Allowance:
        """Its tolerance and the reason."""
        return cast(Allowance, self.fact.tolerance)

    @property
    def tolerance(self) -> float:
        """Tolerance in the fact's unit, > 0."""
        return self.allowance.around(self.fact.value)

    def residual(self, computed: float) -> float:
        """Return computed less stated, in units of the tolerance."""
        return (computed - self.fact.value) / self.tolerance


_FILE = SourceFile(Path(__file__).parents[1] / "dardanelli2010_measured.toml")
_TIME = replace(ALLOWANCES["corner"], what="time constants of Table 4")


def _table4(region: str) -> Iterator[Statement]:
    """Yield the row of a region: gain, two time constants, and what the slow pair does."""
    row, model = FACTS.table(f"table4.{region}"), table4_model(region)
    height = FACTS["fig6_step"].value
    _, high = step_peak(model, height)
    where = f"Table 4, {region} pressure"
    yield Statement(f"table4.{region}.K", replace(row["K"], note="step of 0.35 A with dither"))
    for key in ("T1", "T2"):
        corner = row[key].value
        time = Fact(
            1e3 / (2.0 * math.pi * corner),
            "ms",
            f"{where}: 1/(2 pi {corner:g} Hz)",
            tolerance=_TIME,
            note="eq. (21) with that gain, fitted to sines of 0.1 A, 1 to 15 Hz",
        )
        yield Statement(f"table4.{region}.{key}", time)
    overshoot = Fact(
        100.0 * (high / (height * model.gain) - 1.0),
        "%",
        f"{where}, eq. (22)",
        tolerance=ALLOWANCES["overshoot"],
        note="highest point of the step over its end after 4 s: what the slow pair "
        "does, whose zero and pole have no counterpart of their own",
    )
    yield Statement(f"table4.{region}.overshoot", overshoot)


def _statements() -> Iterator[Statement]:
    for region in REGIONS:
        yield from _table4(region)
    for name, fact in FACTS.table("table3").items():
        digit = _FILE.allowances[name]
        yield Statement(f"table3.{name}", replace(fact, tolerance=digit, note="the parameter"))
    ratio = "area of the loop with dither over that without, averaged over a dither period"
    error = "mean of the last 0.24 s of hard braking less 37 bar"
    read = _FILE.facts
    for name, fact in (
        ("fig5.p_max", read["fig5.p_max"]),
        ("fig5.i_max", read["fig5.i_max"]),
        ("fig5.loop_area_ratio", replace(FACTS["fig5_loop"], note=ratio)),
        ("fig6.peak", read["fig6.peak"]),
        ("fig7.peak", read["fig7.peak"]),
        ("fig7.steady_state_error", replace(FACTS["steady_state"], note=error)),
    ):
        yield Statement(name, fact)


STATEMENTS = tuple(_statements())
"""every misfit term: (computed - stated)/tolerance"""


def allowances() -> tuple[Allowance, ...]:
    """Return the tolerances in use, each once."""
    return tuple(dict.fromkeys(statement.allowance for statement in STATEMENTS))
