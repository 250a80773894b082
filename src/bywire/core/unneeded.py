"""What libraries do although nobody here needs it."""

from __future__ import annotations

import logging
import sys
from typing import Any

_NAME = "dask"
_modules: dict[str, Any] = sys.modules


def leave_out_dask() -> None:
    """Have xarray do without dask in this process.

    To recognize arrays of dask that nobody made, xarray imports ``dask.array`` wherever it is
    installed, which takes as long as half a short run.
    """
    _modules.setdefault(_NAME, None)


def allow_dask() -> None:
    """Have dask again: something that may want it is about to be loaded."""
    if _NAME in _modules and _modules[_NAME] is None:
        del _modules[_NAME]


def silence_matplotlib() -> None:
    """Have matplotlib not tell that it keeps its fonts elsewhere where home is read-only."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
