"""Find the sizing studies by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from bywire.analysis import studies
from bywire.analysis.study import Study
from bywire.core.errors import unknown_name


@cache
def all_studies() -> Mapping[str, Study]:
    """Return every study: the ``STUDY`` of each module in ``studies``."""
    found: dict[str, Study] = {}
    for module in pkgutil.iter_modules(studies.__path__):
        loaded = importlib.import_module(f"{studies.__name__}.{module.name}")
        study = getattr(loaded, "STUDY", None)
        if study is not None:
            found[study.name] = study
    return found


def find_study(name: str) -> Study:
    """Return one study.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    known = all_studies()
    if name not in known:
        raise unknown_name("study", name, known)
    return known[name]
