"""With many choices, the contracts test each choice but not every combination."""

from typing import Literal

from bywire.contracts.element_contracts import MANY, combinations
from bywire.core.parameters import ParameterSet

Letter = Literal["a", "b", "c", "d", "e"]


class Few(ParameterSet):
    """25 combinations."""

    first: Letter
    second: Letter


class Many(Few):
    """125 combinations."""

    third: Letter


def test_few_choices_are_tried_in_every_combination():
    tried = [tuple(each.values()) for each in combinations({"par": Few})]
    assert len(set(tried)) == len(tried) == 25 <= MANY


def test_of_many_choices_each_is_tried_in_two_company():
    tried = list(combinations({"par": Many}))
    assert 25 <= len(tried) <= MANY < 125
    for name in ("par.first", "par.second", "par.third"):
        for letter in "abcde":
            assert sum(each[name] == letter for each in tried) >= 2
