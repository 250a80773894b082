"""Names of options of an experiment where parameters are named too: ``options.NAME``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

T = TypeVar("T")

OPTION = "options."
"""what stands before the name of an option"""


def split_options(named: Mapping[str, T]) -> tuple[dict[str, T], dict[str, T]]:
    """Return what is said of parameters, and of options by their names without the beginning.

    Examples
    --------
    >>> split_options({"motor.R_m": 0.2, "options.p_to": 25e5})
    ({'motor.R_m': 0.2}, {'p_to': 2500000.0})
    """
    parameters = {name: each for name, each in named.items() if not name.startswith(OPTION)}
    options = {
        name.removeprefix(OPTION): each for name, each in named.items() if name.startswith(OPTION)
    }
    return parameters, options
