"""Our models meet all contracts that users' models must meet."""

from __future__ import annotations

import pytest

from bywire.contracts.subjects import demands_on
from bywire.core.model import ASSEMBLIES
from bywire.simulation.compiler import find_compiler

NOT_CHECKED = {
    "wedge-corner": {"linear model"},  # it rolls
    "wedge-corner-electric": {"linear model"},  # it rolls
    "two-wheeler-by-wire": {"linear model", "exact rest"},  # it rolls
    "wedge-brake": {"linear model", "exact rest"},  # its disc turns; the steep one slides
    "two-wheeler-whole-rear": {"linear model"},  # it rolls
    "wheel-on-drum": {"exact rest"},  # it turns
    "driven-shaft": {"*"},  # only an example brings its parameters
}
"""what cannot be put to the test: this list, and nothing else"""
LONG = {
    ("two-wheeler-by-wire", "derivatives of a run"),
    ("wedge-brake", "derivatives of a run"),
    ("wedge-corner", "derivatives of a run"),
    ("two-wheeler-by-wire", "order of the step"),
    ("wedge-corner", "order of the step"),
    ("wedge-brake", "order of the step"),
    ("wedge-corner", "exact rest"),
    ("wedge-corner", "lanes"),
    ("wedge-corner-electric", "derivatives of a run"),
    ("wedge-corner-electric", "order of the step"),
    ("wedge-corner-electric", "exact rest"),
    ("wedge-corner-electric", "lanes"),
    ("two-wheeler-by-wire", "lanes"),
    ("two-wheeler-whole-rear", "derivatives of a run"),
    ("two-wheeler-whole-rear", "order of the step"),
    ("two-wheeler-whole-rear", "lanes"),
}
"""what takes as long as all else of a model; other models put the contract to the test, tests of
stops halve the step, and every experiment of the vehicle runs in lanes as alone"""

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.mark.trust
@pytest.mark.parametrize(("name", "contract"), LONG)
def test_model_keeps_its_long_contracts(name: str, contract: str) -> None:
    findings = [d.settle() for d in demands_on(name, ()) if d.name == contract]
    assert [f.outcome for f in findings] == ["holds"], [str(f) for f in findings]


@pytest.mark.parametrize("name", sorted(ASSEMBLIES.all()))
def test_model_keeps_its_contracts(name: str) -> None:
    findings = [d.settle() for d in demands_on(name, ()) if (name, d.name) not in LONG]
    assert [str(f) for f in findings if f.outcome == "broken"] == []
    unchecked = {f.contract for f in findings if f.outcome == "not checked"}
    known = NOT_CHECKED.get(name, set())
    assert known == {"*"} or unchecked == known, [str(f) for f in findings]
