"""Samples of a friction record that slide, and whether they are friction at all."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.identification.wrong_sign import wrong_sign

_LEAST = 20  # samples each way


def sliding(records: Mapping[str, xr.Dataset], slowest: float) -> dict[str, xr.Dataset]:
    """Return the samples that slide, by record.

    Parameters
    ----------
    records
        ``friction``, ``speed`` and, where measured, ``pressure`` over ``time``; NaN in gaps.
    slowest
        Slower samples are left out; a share of the record's fastest speed.

    Raises
    ------
    ParameterError
        When too few slide forward or backward, or the friction drives the motion.
    """
    names = ("friction", "speed", "pressure")
    found = {}
    for label, one in records.items():
        kept = one[[n for n in names if n in one]]
        v = np.abs(kept["speed"].values)
        good = np.all([np.isfinite(kept[n].values) for n in kept.data_vars], axis=0)
        rows = np.flatnonzero(good & (v > slowest * np.max(v[good], initial=0.0)))
        found[label] = kept.isel(time=rows)
    _require_both_ways(found, slowest)
    _require_braking(found)
    return found


def _require_both_ways(sliding: Mapping[str, xr.Dataset], slowest: float) -> None:
    """Refuse records in which too few samples slide forward, or backward."""
    v = np.concatenate([one["speed"].values for one in sliding.values()])
    counts = {"forward": int(np.sum(v > 0)), "backward": int(np.sum(v < 0))}
    short = [way for way, count in counts.items() if count < _LEAST]
    if short:
        said = ", ".join(f"{count} {way}" for way, count in counts.items())
        raise ParameterError(
            f"too few samples slide {' and '.join(short)} ({said}; {_LEAST} each way are needed): "
            "record motion to and fro (speed changes its sign), or lower --option slowest, which "
            f"leaves out what is slower than {100 * slowest:g} % of a record's fastest speed"
        )


def _require_braking(sliding: Mapping[str, xr.Dataset]) -> None:
    """Refuse friction that gives power: it takes some up, in the mean over the record."""
    F, v = (np.concatenate([one[n].values for one in sliding.values()])
            for n in ("friction", "speed"))  # fmt: skip
    along = float(F @ v / np.sqrt((F @ F) * (v @ v))) if F.any() else 0.0
    if along < 0.0:
        raise wrong_sign("friction", "speed", f"cosine {along:.2f}: it would drive the motion")
