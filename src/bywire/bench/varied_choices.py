"""Which choices of a bench vary from case to case: those of the brake, and among the options."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from bywire.bench.bench import Bench
from bywire.bench.option_names import OPTION
from bywire.core.parameters import ParameterSet, choice_fields, choices_of


def varied_choices(bench: Bench) -> Mapping[str, tuple[Any, ...]]:
    """Return what every choice of a bench that may vary can be, by its name.

    Structural choices of the brake, and of the options ``options.NAME`` those that are listed
    or true or false: a text of another kind names a signal, or a file.
    """
    return choices_that_vary(type(bench.par), type(bench.chosen_options))


@lru_cache(maxsize=64)  # the cases of a study ask for the same ones
def choices_that_vary(
    of: type[ParameterSet], chosen: type[ParameterSet]
) -> Mapping[str, tuple[Any, ...]]:
    """Return the same by the classes of a bench's parameters and options."""
    options = {f"{OPTION}{name}": choices_of(chosen, name) for name in choice_fields(chosen)}
    parameters = {name: choices_of(of, name) for name in choice_fields(of)}
    return parameters | {name: admitted for name, admitted in options.items() if admitted}
