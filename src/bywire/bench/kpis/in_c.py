"""Families of key figures in C: for lanes and for pages, where the Python of one run is too slow.

Python says what a key figure is, for one run and where there is no compiler. A family may do the
same in C as well, in a file of its name beside it: the same operations in the same order, so that
every bit is the same, which a test requires. C tells numbers; why a case has none is told in
Python, of this case.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError
from bywire.core.typing import Array
from bywire.simulation.compiler import find_compiler, load_library

HEADERS = Path(__file__).parent
UNSOUND = "not a number, or no rows"
_FLAGS = ("-O3", "-march=native")  # loops over samples: vectors pay, and sums keep their order


@dataclass(frozen=True)
class InC:
    """How a family's C is called.

    Parameters
    ----------
    signals
        Fields of the family's setting that name signals, in the order of the C.
    reasons
        In short, for pages: why one figure is not defined, from the C's 1 on.
    open
        Which of these, from 1 on, leave open what the figure is.
    failures
        In short likewise: why there are none at all, from the C's 1 on.
    packed
        ``packed(setting, cases)``: what the C takes of a setting whose levels may be those of each
        case.
    note
        ``note(setting)``: how the samples were treated.
    units
        ``units(level, setting)``: unit of every placeholder that the figures declare, by the SI
        unit of the first signal.
    room
        Numbers that it needs for each sample beside the signals.
    is_alone_in_python
        Whether its Python takes a single case, so that without C each is judged for itself.
    """

    signals: tuple[str, ...]
    reasons: tuple[str, ...] = ()
    open: tuple[int, ...] = ()
    failures: tuple[str, ...] = (UNSOUND,)
    packed: Callable[[Any, int], Array] = lambda setting, cases: np.zeros(1)
    note: Callable[[Any], str] = lambda setting: ""
    units: Callable[[str, Any], Mapping[str, str]] = lambda level, setting: {"level": level}
    room: int = 0
    is_alone_in_python: bool = False


def entry_of(family: str) -> str:
    """Return the name of a family's function in C."""
    return f"bw_{family}"


def source_of(path: Path) -> str:
    """Return the C of a family in one piece."""

    def included(name: re.Match[str]) -> str:
        return source_of(HEADERS / name[1])

    return re.sub(r'#include "(\w+\.h)"\n', included, path.read_text(encoding="utf-8"))


@cache
def _function(family: str, path: Path) -> Any:
    """Return the compiled function of a family; None without a compiler."""
    compiler = find_compiler()
    if compiler is None or not path.exists():
        return None
    entry = entry_of(family)
    try:
        library, _ = load_library(source_of(path), _FLAGS, compiler, entry)
    except CompilerError:
        return None
    function = getattr(library, entry)
    function.argtypes = [ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 6]
    function.restype = ctypes.c_int32
    return function


def figures_in_c(
    family: str,
    path: Path,
    how: InC,
    setting: Any,
    time: Array,
    signals: Sequence[Array | None],
    count: int,
) -> tuple[Array, NDArray[np.int32]] | None:
    """Return a family's figures of many cases, and which of them are not defined.

    Parameters
    ----------
    family, path, how
        Name of the family, its C, and how that is called.
    setting
        Its setting, levels of each case among it as arrays.
    time
        Times [s], shape ``(n,)``.
    signals
        Signals in the order of ``how.signals``, shape ``(cases, n)``; None where there is none.
    count
        How many figures the family has.

    Returns
    -------
    tuple
        Values, NaN where they are not defined, and why in the family's own numbers, 0 where they
        are; shape ``(figures, cases)`` each. None where Python has to say it: without a compiler,
        and of samples that define no figure at all.
    """
    function = _function(family, path)
    given = [each for each in signals if each is not None]
    if function is None or not given or any(each.ndim != 2 for each in given):
        return None
    cases, n = given[0].shape
    if any(each.shape != (cases, n) for each in given) or time.shape != (n,):
        return None
    kept = [None if each is None else _in_rows(each) for each in signals]
    places = np.array(
        [(0, 0) if y is None else (y.ctypes.data, y.strides[0] // 8) for y in kept], dtype=np.int64
    )
    t, packed = np.ascontiguousarray(time), np.ascontiguousarray(how.packed(setting, cases))
    work = np.empty(max(1, how.room * n))
    values: Array = np.empty((count, cases))
    reasons: NDArray[np.int32] = np.empty((count, cases), dtype=np.int32)
    arrays = (t, places, packed, work, values, reasons)
    failed = function(cases, n, *(each.ctypes.data for each in arrays))
    return None if failed else (values, reasons)


def _in_rows(y: Array) -> Array:
    """Return signals of which each case's samples stand in one piece."""
    is_so = y.dtype == np.float64 and y.strides[1] == 8 and y.strides[0] % 8 == 0
    return y if is_so else np.ascontiguousarray(y, dtype=np.float64)
