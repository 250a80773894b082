"""Names for your own brake, all importable from one place, two levels deep.

Models, experiments, loops, methods, studies and sources in a user's package or file import their
names from here, independent of where bywire defines the names. Elements come from ``bywire.plant``
and ``bywire.control``, and functions of symbols from ``bywire.core.ops``. bywire loads each name on
first use, so that a listing loads no figures.

>>> from bywire.authoring import Brake, Part, chosen
>>> chosen(0.3, "a motor of this size").kind
'chosen'
"""

from __future__ import annotations

from typing import Any

from bywire.core.lazy_names import LazyNames

_names = LazyNames(__file__)


def __getattr__(name: str) -> Any:
    return _names.load(name)


def __dir__() -> list[str]:
    return _names.all()
