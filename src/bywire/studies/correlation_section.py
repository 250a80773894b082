"""The sections ``[[correlation]]``: what varies with what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Names, Section
from bywire.studies.correlation import correlation_factor
from bywire.studies.plan import Varied
from bywire.studies.single_values import rising

_EXAMPLE = Hint("write for instance of = ['motor.R_m', 'motor.K_e'] and value = 0.5")


class CorrelationSection(Section):
    """A section ``[[correlation]]``: two quantities, and the correlation of their scores."""

    of: Annotated[Names, _EXAMPLE]
    value: Annotated[float, Unit("1"), Field(gt=-1, lt=1), _EXAMPLE]


def in_order(
    varied: Sequence[Varied], correlations: Mapping[tuple[str, str], float]
) -> tuple[Varied, ...]:
    """Return what varies; single values that are correlated rise, however the file lists them."""
    correlated = {name for pair in correlations for name in pair}
    return tuple(
        replace(each, distribution=rising(each.distribution))
        if each.name in correlated and each.distribution.is_discrete
        else each
        for each in varied
    )


def read_correlations(
    sections: Sequence[CorrelationSection],
    varied: Sequence[Varied],
    known: Mapping[tuple[str, str], float],
) -> dict[tuple[str, str], float]:
    """Return the correlations of ``[[correlation]]`` by pairs of names in alphabetical order.

    Parameters
    ----------
    sections
        What the file says.
    varied
        What varies.
    known
        Correlations that are known already.

    Raises
    ------
    InputError
        For entries that do not fit, and correlations that no quantities can have.
    """
    names = {each.name: each for each in varied}
    pairs: dict[tuple[str, str], float] = {}
    for section in sections:
        pair = section.of
        if len(pair) != 2 or pair[0] == pair[1]:
            raise ParameterError(f"[[correlation]] of = {quoted(list(pair))}: two names are wanted")
        for name in pair:
            if name not in names:
                raise unknown_name("quantity of [[correlation]]", name, names)
            if not names[name].unit:
                raise ParameterError(
                    f"[[correlation]] of {pair[0]} and {pair[1]}: {name} is a choice, and what has "
                    "no order neither rises nor falls with another: leave it out, or make a study "
                    "for each of its values"
                )
        first, second = sorted(pair)
        if (first, second) in {**known, **pairs}:
            raise ParameterError(f"[[correlation]] of {first} and {second} stands there twice")
        pairs[first, second] = section.value
    correlation_factor(list(names), {**known, **pairs})
    return pairs
