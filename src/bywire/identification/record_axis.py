"""One axis for records that are shown one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.core.typing import Array


def after_one_another(times: Mapping[str, Array]) -> dict[str, Any]:
    """Return coordinates for records in a row: ``time``, which goes on, and ``record``, the names.

    Parameters
    ----------
    times
        By record: instants within it [s], shape (n_k,), ascending; not all of its samples need
        be there. A single record without a name gets no ``record``.
    """
    begin, axis, names = 0.0, [], []
    for name, t in times.items():
        if t.size:
            axis.append(begin + t)
            begin = float(axis[-1][-1]) + (float(np.median(np.diff(t))) if t.size > 1 else 0.0)
        names += [name] * t.size
    attrs = {
        "units": "s",
        "long_name": "time, records in a row" if len(times) > 1 else "time",
    }
    found: dict[str, Any] = {"time": ("time", np.concatenate(axis), attrs)}
    if len(times) > 1:
        found["record"] = ("time", np.array(names))
    return found
