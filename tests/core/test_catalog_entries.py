"""The catalog: every value has its provenance, and every parameter its value."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import get_args

import pytest

import bywire
from bywire.core.catalog import PARAMETER_SETS, CitedSet
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.core.model import ASSEMBLIES
from bywire.core.parameters import choice_fields, leaf_fields
from bywire.core.provenance import Cited, Kind, calibrated, chosen, derived, paper

NAMES = sorted(PARAMETER_SETS.all())


def check_provenance(found: CitedSet) -> None:
    """Refuse an entry with a value that does not say where it comes from."""
    for name, cited in found.values.items():
        assert isinstance(cited, Cited), name
        assert cited.kind in get_args(Kind), name
        assert len(cited.where.strip()) > 3, name
        if cited.kind == "paper":
            # A place in the source, so that it can be looked up.
            place = r"Table|Tab\.|section|Section|eq\.|Eq\.|\(\d+\)|Fig|page|p\. |the ECU knows"
            assert re.search(place, cited.where), f"{name}: {cited.where!r} names no place"


def check_coverage(found: CitedSet) -> None:
    """Refuse an entry that leaves a parameter out, or has one too many."""
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
    with pytest.raises(ParameterError, match=r"motor\.R_m = -1\.0 ohm"):
        replace(found, values=values).parameters()


def test_unknown_set():
    with pytest.raises(UnknownNameError, match="did you mean 'dardanelli2010'"):
        PARAMETER_SETS.find("dardaneli2010")
    with pytest.raises(UnknownNameError, match="unknown parameter set"):
        bywire.parameters("../dardanelli2010")


def test_kinds_of_provenance():
    made = [paper(1, "a"), derived(1, "a"), chosen(1, "a"), calibrated(1, "a")]
    assert [cited.kind for cited in made] == ["paper", "derived", "chosen", "calibrated"]
    assert set(get_args(Kind)) == {cited.kind for cited in made}
