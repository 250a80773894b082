"""Every contract of a model rejects the template's brake with a seeded mistake."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from bywire.analysis.linear import linearize
from bywire.api.new import write_package
from bywire.contracts import model_contracts
from bywire.contracts.evidence import Evidence, examine
from bywire.contracts.model_contracts import OF_A_MODEL
from bywire.contracts.subjects import demands_on
from bywire.simulation import engine, scheme
from bywire.simulation.compiler import find_compiler
from bywire.simulation.symbols import SX
from systems.loading import loaded

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

OPS = (
    "from bywire.plant import dc_motor",
    "from bywire.core import ops\nfrom bywire.plant import dc_motor",
)
STAIRS = (
    "w.F = caliper_spring.output(w.caliper.u, w.caliper.par)",
    "w.F = 200.0 * ops.floor(caliper_spring.output(w.caliper.u, w.caliper.par) / 200.0)",
)


class Mistake(NamedTuple):
    """A change in a file of the template, and the contract that must detect it."""

    contract: str
    file: str
    changes: tuple[tuple[str, str], ...]


MISTAKES = {
    "wrong sign in a balance": Mistake(
        "energy of a run", "model", (("spindle.Input(torque, w.F)", "spindle.Input(torque, -w.F)"),)
    ),
    "loss counted twice": Mistake(
        "energy of a run", "model", ((": -w.reaction[0] *", ": -2.0 * w.reaction[0] *"),)
    ),
    "loss that gives": Mistake(
        "energy of a run", "model", ((": -w.reaction[0] *", ": w.reaction[0] *"),)
    ),
    "source with half the voltage": Mistake(
        "energy of a run", "model", (("w.m.v * w.motor.x.i", "0.5 * w.m.v * w.motor.x.i"),)
    ),
    "loss left out": Mistake(
        "energy of a run",
        "elements/spindle",
        (("return par.d * x.omega * x.omega", "return 0.0 * par.d * x.omega * x.omega"),),
    ),
    "force of first order": Mistake("order of the step", "model", (OPS, STAIRS)),
    "force without slope": Mistake("derivatives of a run", "model", (OPS, STAIRS)),
    "friction that creeps": Mistake(
        "hidden friction",
        "model",
        (
            OPS,
            (
                "return ((-T, T),)",
                "T = T * ops.fmin(ops.fabs(w.spindle.x.omega), 1.0)\n        return ((-T, T),)",
            ),
        ),
    ),
    "friction in the balance": Mistake(
        "hidden friction",
        "elements/spindle",
        (("- par.d * x.omega)", "- par.T_0 * x.omega / (abs(x.omega) + 1e-3))"),),
    ),
    "bounds the wrong way round": Mistake(
        "exact rest", "model", (("return ((-T, T),)", "return ((T, -T),)"),)
    ),
    "kink where it rests": Mistake(
        "linear model",
        "model",
        (OPS, ("dc_motor.Input(w.m.v,", "dc_motor.Input(0.53 + ops.fabs(w.m.v - 0.53),")),
    ),
    "torque and force mixed up": Mistake(
        "units", "model", (("spindle.Input(torque, w.F)", "spindle.Input(w.F, torque)"),)
    ),
}


FAULTS = """
from bywire.authoring import Channel, Channels
from {package}.model import {model}

CHANNELS = Channels({model}.name, (Channel("angle", "angle sensor", "rad", "{signal}"),))
"""


@contextmanager
def seeded(folder: Path, name: str, mistake: Mistake | None = None) -> Iterator[Any]:
    """Yield the trial of a template's brake with a mistake, and unload it at the end."""
    package = write_package(name, folder) / "src" / name.replace("-", "_")
    if mistake is not None:
        source = package / f"{mistake.file}.py"
        text = source.read_text(encoding="utf-8")
        for right, wrong in mistake.changes:
            assert text.count(right) == 1, "the place of the mistake has moved"
            text = text.replace(right, wrong)
        source.write_text(text, encoding="utf-8")
    with loaded(package):
        yield next(demand.on for demand in demands_on(f"{name}-actuator", ()))


@pytest.mark.parametrize("mistake", MISTAKES)
def test_gate_refuses(mistake: str, tmp_path: Path) -> None:
    wanted = MISTAKES[mistake]
    name = f"seeded-{list(MISTAKES).index(mistake)}"
    with seeded(tmp_path, name, wanted) as subject:
        found = examine(OF_A_MODEL[wanted.contract], subject, subject.place())
    assert not found.holds, found.text


def test_a_linear_model_that_is_the_mean_of_two_sides_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Differentiation of a magnitude at 0 silently gives the mean."""
    monkeypatch.setattr(linearize, "linear_models", lambda of: of.models(of.point))
    with seeded(tmp_path, "seeded-mean", MISTAKES["kink where it rests"]) as subject:
        found = examine(OF_A_MODEL["linear model on kinks"], subject, subject.place())
    assert not found.holds, found.text
    assert re.search(r"\w+\.py:\d+ at its kink", found.text)


def test_every_gate_lets_the_right_brake_pass(tmp_path: Path) -> None:
    with seeded(tmp_path, "seeded-none") as subject:
        found = {name: examine(contract, subject) for name, contract in OF_A_MODEL.items()}
    assert {name: each.text for name, each in found.items() if not each.holds} == {}


def test_reversals_that_are_not_located_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rule of old: nothing is cut, and the sign at the end of a substep holds for all of it."""
    monkeypatch.setattr(scheme, "_acting", lambda v, low, high: (low, high))
    monkeypatch.setattr(scheme, "_turn", lambda model, start, end: SX(0))
    monkeypatch.setattr(engine, "_PREPARED", {})
    with seeded(tmp_path, "seeded-reversal") as subject:
        found = examine(OF_A_MODEL["order of the step"], subject)
    assert not found.holds, found.text


@pytest.mark.parametrize("contract", ["engines", "lanes"])
def test_engines_that_differ_are_refused(
    contract: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def off(run: Any, *rest: Any, engine: str = "auto") -> Any:
        found = original(run, *rest, engine=engine)
        if engine != "compiled":
            found.values[-1] *= 1.0 + 1e-6
        return found

    original = model_contracts.simulate
    monkeypatch.setattr(model_contracts, "simulate", off)
    with seeded(tmp_path, f"seeded-{contract}") as subject:
        found: Evidence = examine(OF_A_MODEL[contract], subject)
    assert not found.holds
