"""What a fit of a bench is worth: checks, figures and curves, held-out record included."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import xarray as xr

from bywire.identification.estimate import Estimate
from bywire.identification.explained import explained
from bywire.identification.fitting.options import Options
from bywire.identification.fitting.unknown_texts import is_parameter
from bywire.identification.method import Check, Curve
from bywire.identification.moved_run import moved_run
from bywire.identification.output_error import Trial
from bywire.identification.replaying.bench_replay import beside
from bywire.identification.replaying.fit import fit_figures
from bywire.identification.replaying.measured_run import MeasuredRun
from bywire.identification.replaying.segments import Segment
from bywire.simulation.run import simulate

_OWN = ("initial.", "start.")  # what each record has for itself
_EXPLAINED = 0.5  # of the variance: what is explained outweighs what is left


@dataclass(frozen=True)
class Compared:
    """A record beside the model with the estimates.

    Parameters
    ----------
    label
        Of the record; empty where there is one alone.
    pairs
        ``measured`` and ``modeled`` over ``time`` [s], by output.
    """

    label: str
    pairs: Mapping[str, xr.Dataset]

    def figures(self, name: str) -> dict[str, float]:
        """Return the figures of an output over the whole record; see ``fit_figures``."""
        time = self.pairs[name]["time"].values
        whole = Segment("all", float(time[0]), float(time[-1]))
        return {k.name: k.value for k in fit_figures(self.pairs[name], whole)}

    def curves(self, role: str) -> tuple[Curve, ...]:
        """Return measured beside modeled, a curve for each output."""
        own = f"-{_file_name(self.label)}" if self.label else ""
        said = f" in {self.label}" if self.label else ""
        return tuple(
            Curve(f"{role}-{name}{own}", f"{name}{said}, {_CAPTIONS[role]}.", pair, "time")
            for name, pair in self.pairs.items()
        )


_CAPTIONS = {
    "fit": "measured and modeled with the estimates",
    "validation": "a record that was not fitted: measured, and modeled with the estimates",
}


def compared(one: MeasuredRun, trial: Trial, found: Estimate) -> Compared:
    """Return a record beside the model with the estimates.

    Parameters
    ----------
    one, trial
        The record; unknowns of its own carry its label, which is empty where it was fitted alone.
    found
        The estimates; what the data does not tell stays where it was.
    """
    values = {
        u.name: float(v)
        for u, v in (
            *zip(found.unknowns, found.values, strict=True),
            *((k.unknown, k.unknown.start) for k in found.kept),
        )
        if u.trial == trial.label or not (u.trial or u.name.startswith(_OWN))
    }
    moving = {name: v for name, v in values.items() if not name.startswith("offset.")}
    made = simulate(moved_run(trial.run, moving, trial.start), one.compared)
    return Compared(
        trial.label,
        {
            name: beside(
                one.data, name, made[name][one.settled:] + values.get(f"offset.{name}", 0.0)
            )
            for name in one.compared
        },
    )  # fmt: skip


def checks_of(trials: Sequence[Trial], found: Estimate, options: Options) -> tuple[Check, ...]:
    """Return whether the model explains the records, and whether the values mean something.

    Noise alone is no proof of a model: where a record is nothing but noise, noise is what any
    model leaves.
    """
    vague = {n: why for n, why in found.vague().items() if _of_bench(found, n)}
    said = "; ".join(f"{label} {reason}" for label, reason in vague.items())
    untold = [k.unknown.label for k in found.kept]
    return (
        Check("residual_over_noise", found.rms, limit=options.most_residual,
              note="1 where nothing but the sensors' noise is left"),
        Check("variance_explained", explained(trials, found), limit=_EXPLAINED, at_least=True,
              note="share of the outputs' variance, over their noise, that the model predicts"),
        Check("parameters_without_meaning", float(len(vague)), limit=0.0,
              note=said or "none at its bound, none with a 95 % interval wider than +-100 %"),
        Check("not_told", float(len(untold)),
              note=", ".join(untold) or "the data tells all that was asked for"),
    )  # fmt: skip


def _of_bench(found: Estimate, label: str) -> bool:
    """Return whether a label is that of a parameter; offsets and starts may be near zero."""
    one = found.unknowns[found.names.index(label)]
    return is_parameter(one.name) and not one.name.startswith(_OWN)


def believable(found: Estimate) -> dict[str, float]:
    """Return the parameters by name, less those whose values mean nothing."""
    vague = found.vague()
    return {
        u.name: float(v)
        for u, v in zip(found.unknowns, found.values, strict=True)
        if _of_bench(found, u.label) and u.label not in vague
    }


def validation_of(held: Compared, options: Options) -> tuple[Check, ...]:
    """Return how much of a held-out record is accounted for, signal by signal."""
    checks = []
    for name in held.pairs:
        figures = held.figures(name)
        vaf = figures["vaf"] / 100.0
        still = "" if math.isfinite(vaf) else "; the measured signal does not move"
        checks += [
            Check(f"validation.{name}.vaf", vaf, limit=options.least_vaf, at_least=True,
                  note=f"variance accounted for in the record that was not fitted{still}"),
            Check(f"validation.{name}.nrmse", figures["nrmse"] / 100.0,
                  note="root mean square of the error there, over the range"),
        ]  # fmt: skip
    return tuple(checks)


def figures_of(
    records: Sequence[Compared], trials: Sequence[Trial]
) -> dict[str, tuple[float, str]]:
    """Return noise, variance accounted for and error of every output in every record."""
    found: dict[str, tuple[float, str]] = {}
    for one, trial in zip(records, trials, strict=True):
        for name, pair in one.pairs.items():
            key = f"{one.label}:{name}" if one.label else name
            figures = one.figures(name)
            unit = str(pair["measured"].attrs.get("units", "1"))
            found |= {
                f"{key}.noise": (trial.noise[name], unit),
                f"{key}.vaf": (figures["vaf"], "%"),
                f"{key}.nrmse": (figures["nrmse"], "%"),
            }
    return found


def _file_name(label: str) -> str:
    return re.sub(r"[^\w.-]+", "_", label)
