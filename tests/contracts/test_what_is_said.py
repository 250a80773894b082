"""Findings of a check: values that broke a contract, one error per cause, valid faults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from annotated_types import Ge

from bywire.api.new import write_package
from bywire.contracts.element_contracts import Sampler, combinations, described
from bywire.contracts.elements import elements_by_name, numbers
from bywire.contracts.evidence import examine, one_by_cause
from bywire.contracts.model_contracts import OF_A_MODEL
from bywire.contracts.subjects import demands_on
from bywire.contracts.trial import Start, start_of
from bywire.core.catalog import parameters
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import Signal, signals_of
from systems import loading

OPENING = Annotated[float, Signal("1", "opening of a valve", 0.5, low=0.0, high=1.0)]
GAUGE = Annotated[float, Signal("Pa", "gauge pressure", 2e6, low=-101_325.0)]
BOUNDED = Annotated[float, Signal("m", "stroke", 1e-3), Ge(0.0)]


@pytest.mark.parametrize(
    ("signal", "low", "high"),
    [(OPENING, 0.0, 1.0), (GAUGE, -101_325.0, 1e8), (BOUNDED, 0.0, 1.0)],
    ids=["opening", "gauge pressure", "stroke"],
)
def test_only_admissible_signals_are_tried(signal: object, low: float, high: float) -> None:
    number = numbers("u", signal)["u"]
    (choices,) = combinations({"u": signal})
    tried = [Sampler({"u": signal}, choices, seed)._draw(number) for seed in range(300)]
    assert low <= min(tried) < max(tried) <= high


def test_runs_of_a_model_keep_to_what_is_admissible(monkeypatch: pytest.MonkeyPatch) -> None:
    start = start_of(ASSEMBLIES.find("motorcycle-brake")(), parameters("dardanelli2010"))
    name = start.model.Stimulus._fields[0]
    known = signals_of(start.model.Stimulus)
    value = float(getattr(start.stimulus, name))
    limited = known | {name: Signal(known[name].unit, "", known[name].nominal, low=value)}
    monkeypatch.setattr("bywire.contracts.trial.signals_of", lambda _: limited)
    rows = Start.run(start, 0.5).stimulus(np.arange(15) * 0.02)
    assert rows[:, 0].min() == value
    assert rows[:, 0].max() > value


def test_what_broke_a_contract_is_said() -> None:
    element = elements_by_name()["adc"]
    sample = Sampler({"reading": Annotated[float, Signal("1", "x")]}, {}).sample()
    assert element.name == "plant.adc"
    assert described({}) == ""
    assert described({"par.law": "ideal"}) == " (with par.law = ideal)"
    assert described({}, sample, [0.25]) == " (with reading = 0.25)"
    assert described({}, sample, [0.25], is_broken=False) == ""


def seeded(folder: Path, name: str, file: str, right: str, wrong: str) -> Path:
    """Write the template's brake with a mistake in a file."""
    package = write_package(name, folder) / "src" / name.replace("-", "_")
    source = package / file
    text = source.read_text(encoding="utf-8") if source.exists() else ""
    assert text.count(right) >= 1 or not right
    source.write_text(text.replace(right, wrong, 1) if right else wrong, encoding="utf-8")
    return package


def test_a_cause_is_one_error(tmp_path: Path) -> None:
    """A renamed parameter prevents the check of all contracts of the model."""
    package = seeded(tmp_path, "renamed", "point.py", "par.", "par.renamed.")
    with loading.loaded(package):
        found = list(one_by_cause(demand.settle() for demand in demands_on("renamed-actuator", ())))
    broken = [each for each in found if each.outcome == "broken"]
    assert len(found) == len(OF_A_MODEL)
    assert [each.text.partition(":")[0] for each in broken] == ["AttributeError"]
    assert broken[0].place.file.endswith("point.py")
    others = {each.text for each in found if each is not broken[0]}
    assert others == {"the error of renamed-actuator (renamed-example): units also occurs here"}


FAULTS = """
from bywire.authoring import Channel, Channels

CHANNELS = Channels("unheard-actuator", (Channel("angle", "angle sensor", "rad", "fi"),))
"""


def test_a_fault_of_an_unknown_signal_is_found(tmp_path: Path) -> None:
    package = seeded(tmp_path, "unheard", "faults.py", "", FAULTS)
    with loading.loaded(package):
        trial = next(demand.on for demand in demands_on("unheard-actuator", ()))
        found = examine(OF_A_MODEL["faults"], trial, trial.place())
    assert not found.holds
    assert "the channel 'angle' refers to 'fi', which is not a signal" in found.text
