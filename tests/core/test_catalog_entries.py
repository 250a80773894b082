"""The catalog: each value has a provenance, and each parameter has a value."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import get_args

import pytest

import bywire
from bywire.core.catalog import (
    PARAMETER_SETS,
    Cited,
    CitedSet,
    Origin,
    calibrated,
    chosen,
    derived,
    outdated_values,
    paper,
)
from bywire.core.errors import ModelError, ParameterError, UnknownNameError
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import ParameterSet, choice_fields, leaf_fields
from bywire.core.quantities import Force, Length, Torque

NAMES = sorted(PARAMETER_SETS.all())


def check_provenance(found: CitedSet) -> None:
    """Reject an entry with a value without a source."""
    for name, cited in found.values.items():
        assert isinstance(cited, Cited), name
        assert cited.kind in get_args(Origin), name
        assert len(cited.where.strip()) > 3, name
        if cited.kind == "paper":
            # A place in the source, so that it can be looked up.
            place = r"Table|Tab\.|section|Section|eq\.|Eq\.|\(\d+\)|Fig|page|p\. |as in the plant"
            assert re.search(place, cited.where), f"{name}: {cited.where!r} names no place"


def check_coverage(found: CitedSet) -> None:
    """Reject an entry that omits a parameter or has an unknown one."""
    fields = {*leaf_fields(found.parameter_class), *choice_fields(found.parameter_class)}
    assert found.values.keys() == fields


@pytest.mark.parametrize("name", NAMES)
def test_every_value_has_a_provenance(name):
    check_provenance(PARAMETER_SETS.all()[name])


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_covered_exactly(name):
    check_coverage(PARAMETER_SETS.all()[name])


@pytest.mark.parametrize("name", NAMES)
def test_entry_is_complete(name):
    found = PARAMETER_SETS.all()[name]
    assert found.name == name == name.lower()
    assert re.search(r"\d{4}", found.source), "a citation has a year"
    assert found.summary
    assert not found.summary.endswith(".")
    assert found.assembly in ASSEMBLIES.all()


@pytest.mark.parametrize("name", NAMES)
def test_values_are_valid_and_those_cited(name):
    par = bywire.parameters(name)
    values = PARAMETER_SETS.find(name).values
    assert par.flat() == {key: cited.value for key, cited in values.items()}
    assert par == type(par).model_validate_json(par.model_dump_json())


def test_gate_of_provenance_can_fail():
    found = PARAMETER_SETS.all()[NAMES[0]]
    key = next(iter(found.values))
    for wrong in (chosen(1.0, ""), chosen(1.0, "  "), paper(1.0, "somewhere"), 1.0):
        with pytest.raises(AssertionError):
            check_provenance(replace(found, values={**found.values, key: wrong}))


def test_gate_of_coverage_can_fail():
    found = PARAMETER_SETS.all()[NAMES[0]]
    first, *others = found.values
    with pytest.raises(AssertionError):
        check_coverage(replace(found, values={key: found.values[key] for key in others}))
    with pytest.raises(AssertionError):
        check_coverage(replace(found, values={**found.values, "extra": found.values[first]}))


def test_wrong_value_is_refused_by_name():
    found = PARAMETER_SETS.all()[NAMES[0]]
    values = {**found.values, "motor.R_m": chosen(-1.0, "seeded")}
    with pytest.raises(ParameterError, match=r"motor\.R_m = -1 ohm"):
        replace(found, values=values).parameters()


def test_unknown_set():
    with pytest.raises(UnknownNameError, match="did you mean 'dardanelli2010'"):
        PARAMETER_SETS.find("dardaneli2010")
    with pytest.raises(UnknownNameError, match="unknown parameter set"):
        bywire.parameters("../dardanelli2010")


def test_kinds_of_provenance():
    made = [paper(1, "a"), derived(1, "a"), chosen(1, "a"), calibrated(1, "a")]
    assert [cited.kind for cited in made] == ["paper", "derived", "chosen", "calibrated"]
    assert set(get_args(Origin)) == {cited.kind for cited in made}


class Lever(ParameterSet):
    """A force, an arm, and the controller's estimates of both."""

    F: Force
    arm: Length
    T_hat: Torque


class Levers(ParameterSet):
    """Two of a kind."""

    left: Lever
    right: Lever


def torque(par):
    return par.F * par.arm


LEVER = {
    "F": chosen(4.0, "a force"),
    "arm": chosen(0.5, "an arm"),
    "T_hat": derived(torque, "F times arm"),
}


@pytest.mark.parametrize(
    "formula",
    [
        lambda par: (1e200 * par.arm) ** 2.0,
        lambda par: 1.0 / (par.arm - 0.25),
        lambda par: math.log(-par.arm),
    ],
)
def test_a_formula_that_has_no_result_no_longer_matches(formula):
    values = LEVER | {"T_hat": derived(lambda par: formula(par) if par.arm < 0.5 else 2.0, "?")}
    lever = CitedSet("lever", "lever", "2026", "a lever", Lever, values)
    (found,) = outdated_values(values, lever.parameters().replace({"arm": 0.25}), {"arm"})
    assert math.isnan(found.formula)


def test_a_derived_value_is_computed_once_and_found_where_it_no_longer_matches():
    lever = CitedSet("lever", "lever", "2026", "a lever", Lever, LEVER)
    par = lever.parameters()
    assert par.T_hat == 2.0
    (found,) = outdated_values(lever.values, par.replace({"arm": 0.25}), {"arm"})
    assert (found.name, found.now, found.formula, found.changed) == ("T_hat", 2.0, 1.0, ("arm",))
    both = par.replace({"arm": 0.25, "T_hat": 1.5})
    assert outdated_values(lever.values, both, {"arm", "T_hat"}) == []
    same = par.replace({"arm": 0.25, "F": 8.0})
    assert outdated_values(lever.values, same, {"arm", "F"}) == []


def test_a_derived_value_follows_its_set_into_another_one():
    values = {
        f"{side}.{name}": each.moved_to({"": side})
        for side in ("left", "right")
        for name, each in LEVER.items()
    }
    levers = CitedSet(
        "levers",
        "levers",
        "2026",
        "two levers",
        Levers,
        {
            **values,
            "right.F": chosen(6.0, "a larger force"),
        },
    )
    assert (levers.parameters().left.T_hat, levers.parameters().right.T_hat) == (2.0, 3.0)
    changed = levers.parameters().replace({"right.arm": 1.0})
    (found,) = outdated_values(levers.values, changed, {"right.arm"})
    assert (found.name, found.formula) == ("right.T_hat", 6.0)


def test_a_formula_that_reads_what_there_is_not_is_refused():
    for formula in (lambda par: par.length, lambda par: par.T_hat):
        with pytest.raises(
            ModelError, match=r"length, which is not in the set|T_hat depend on each"
        ):
            CitedSet("lever", "lever", "2026", "", Lever, {**LEVER, "T_hat": derived(formula, "x")})


@pytest.mark.parametrize(
    ("name", "changed", "derived_name", "value"),
    [
        ("sport600", {"vehicle.body.h": 0.7}, "ecu.front_lift.a_lim", 0.95 * 9.81 * 0.69 / 0.7),
        ("front600", {"brake.disc.mu_pad": 0.3}, "slip.k_hat", 4 * 0.3 * 14.1e-4 * 0.13),
        ("roberts2003-corner", {"screw.lead": 4e-3}, "control.offset.k_hat", 2e-3 / math.pi),
        ("dardanelli2010-measured", {"seal.k_brk_p": 3.0}, "ecu.est_par.k_brk_p", 3.0),
    ],
)
def test_derived_values_of_our_sets_are_found(name, changed, derived_name, value):
    found = PARAMETER_SETS.find(name)
    outdated = outdated_values(found.values, found.parameters().replace(changed), changed)
    formulas = {each.name: each.formula for each in outdated}
    assert formulas[derived_name] == pytest.approx(value, rel=1e-12)
