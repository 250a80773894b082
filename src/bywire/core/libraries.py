"""Libraries: their threads, their unwanted imports, and the installation of optional libraries.

Linear algebra runs on one thread. The systems here are small, with tens of unknowns and a few
columns in a Jacobian. BLAS threads would spend more time waiting for each other than computing.
They spin while they wait and thus take the cores from simulations. On one thread, reproducing
Dardanelli et al. (2010) takes two thirds of the time. Sums are also independent of the number of
cores.

This module never changes a number of threads that the environment sets.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from threadpoolctl import threadpool_limits

_DEFAULTS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# Libraries that start threads on import, which bywire never uses: numexpr, which pandas imports,
# and the allocator of pyarrow. A process with threads cannot be copied safely.
_IDLE_THREADS = {
    "NUMEXPR_NUM_THREADS": "1",
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
}
VARIABLES = (*_DEFAULTS, "OMP_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""environment variables that set the number of threads"""


def one_thread_variables() -> dict[str, str]:
    """Return the environment variables for a child process whose libraries start no threads."""
    return {**dict.fromkeys(_DEFAULTS, "1"), "OMP_NUM_THREADS": "1", **_IDLE_THREADS}


def keep_one_thread() -> None:
    """Limit this process to one thread, even if its libraries are already loaded."""
    os.environ.update({k: v for k, v in _IDLE_THREADS.items() if k not in os.environ})
    if _is_chosen():
        return
    os.environ.update(dict.fromkeys(_DEFAULTS, "1"))
    if "numpy" in sys.modules:
        from threadpoolctl import threadpool_limits

        threadpool_limits(1, "blas")


@contextmanager
def on_one_thread() -> Iterator[None]:
    """Compute on one thread within this block, in a process that belongs to the caller.

    Blocks may overlap, even in several threads. The last block to end restores the former limits.
    """
    if _is_chosen():
        yield
        return
    _limited.begin()
    try:
        yield
    finally:
        _limited.end()


def _is_chosen() -> bool:
    """Return whether the environment sets the number of threads."""
    return any(os.environ.get(name) for name in VARIABLES)


class _Limited:
    """Limit on threads, in force while at least one block needs it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._count = 0
        self._limits: threadpool_limits | None = None

    def begin(self) -> None:
        """Set the limit unless it is set already."""
        with self._lock:
            if self._limits is None:
                import scipy.linalg  # noqa: F401  a limit affects only a BLAS that is loaded
                from threadpoolctl import threadpool_limits

                self._limits = threadpool_limits(1, "blas")
            self._count += 1

    def end(self) -> None:
        """Restore the former limits once the last block has ended."""
        with self._lock:
            self._count -= 1
            if self._count == 0 and self._limits is not None:
                self._limits.restore_original_limits()
                self._limits = None


_limited = _Limited()


# --- Imports and messages that bywire does not need

_modules: dict[str, Any] = sys.modules


def leave_out_dask() -> None:
    """Keep xarray from importing dask in this process.

    To recognize dask arrays, xarray imports ``dask.array`` if it is installed. This takes half as
    long as a short run.
    """
    _modules.setdefault("dask", None)


def allow_dask() -> None:
    """Allow imports of dask again, before loading code that may need it."""
    if "dask" in _modules and _modules["dask"] is None:
        del _modules["dask"]


def silence_matplotlib() -> None:
    """Silence matplotlib's note on the location of its fonts if the home folder is read-only."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)


# --- Optional libraries


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra from a clone, because no package index has bywire.

    Examples
    --------
    >>> how_to_install("measurements")
    "in your clone: pip install -e '.[measurements]'"
    """
    return f"in your clone: pip install -e '.[{extra}]'"
