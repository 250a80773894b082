"""Names for writing your own brake: one place to import from, two levels deep.

Models, experiments, loops, methods, studies and sources of a user's package or file take their
names from here, wherever those stand inside bywire; elements come from ``bywire.plant`` and
``bywire.control``, functions of symbols from ``bywire.core.ops``. Everything is loaded on first
use, so that a listing loads no figures.

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
