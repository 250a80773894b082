"""The options of an identification method, as ``--option KEY=VALUE`` sets them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from bywire.core.errors import InputError

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.identification.method import Method


def method_options(method: Method, texts: Mapping[str, str]) -> ParameterSet:
    """Return a method's options with some of them changed.

    Parameters
    ----------
    method
        Gives the class and the defaults.
    texts
        By name, as on the command line.

    Raises
    ------
    InputError
        Of the kind that fits, with the way to the list of options.
    """
    from bywire.bench.values import parsed

    try:
        given = parsed(method.options, texts, f"option of {method.name}")
        return method.defaults.replace(given)
    except InputError as error:
        raise type(error)(f"{error}; 'bywire list {method.name}' shows the options") from None
