"""Table 3 and Fig. 4 as the paper got them: the ramp's experiment on our own brake."""

from __future__ import annotations

from functools import cache

from bywire.brakes.motorcycle.methods import friction_ramp
from bywire.brakes.motorcycle.paper import facts
from bywire.brakes.motorcycle.paper.runs import MAIN, parameters
from bywire.identification.method import Effort, Identified
from bywire.report.method_curve import method_curve
from bywire.reproduction.item import Item, compared
from bywire.reproduction.reproduction import Exhibit

SEED = 1
OFF = {"k_brk_p": 0.9, "f_cfr_p": 0.8, "c": 1.2, "f_cfr_n": 1.2, "k_brk_n": 1.1, "T_pr": 1.2}
"""where the search begins, over the values put in"""


@cache
def identified() -> Identified:
    """Return the friction identified from a simulated ramp (17), from a start off the truth."""
    par = parameters(MAIN)
    seal = par.seal.flat()
    start = par.replace({f"seal.{name}": share * seal[name] for name, share in OFF.items()})
    options = friction_ramp.METHOD.defaults
    data = friction_ramp.METHOD.synthetic(par, options, SEED)
    return friction_ramp.METHOD.identify(data, start, options, Effort(starts=1))


def items() -> list[Item]:
    """Return Table 3's values, put in, beside what comes back."""
    estimate = identified().estimates["seal friction"]
    ends = dict(zip(estimate.names, estimate.intervals().tolist(), strict=True))
    rows: list[Item] = []
    for name, fact in facts.TABLE3.items():
        label = f"seal.{name}"
        if label not in ends:
            continue
        low, high = ends[label]
        rows.append(
            compared(
                f"table3.identified.{name}", fact, estimate[label], None,
                f"identified from our own ramp, where it was put in; 95 % interval {low:.4g} to "
                f"{high:.4g}; the search began {100.0 * (OFF[name] - 1.0):+.0f} % off",
            )
        )  # fmt: skip
    return rows


def text() -> str:
    """Return what the ramp does not tell."""
    kept = identified().estimates["seal friction"].kept
    if not kept:
        return ""
    names = " and ".join(k.unknown.name.removeprefix("seal.") for k in kept)
    return f" The ramp of eq. (17), identified on our own brake, does not tell {names}."


def exhibit() -> Exhibit:
    """Return Fig. 4 as identified, with the band that noise leaves."""
    curve = next(c for c in identified().curves if c.name == "stribeck")
    widest = float((curve.data["high"] - curve.data["value"]).max())
    return Exhibit(
        "fig4-identified",
        method_curve(curve),
        "Fig. 4 as identified on our own brake from one ramp with sensors' noise; bands: 95 % "
        f"confidence, {widest:.1g} N m to either side at most.",
    )
