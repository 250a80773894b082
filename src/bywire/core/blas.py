"""Linear algebra on one thread.

What is solved here is small: tens of unknowns, Jacobians with a few columns. The threads of a BLAS
then wait for each other longer than they compute, and wait by spinning, which takes the cores from
simulations: without them, reproducing Dardanelli et al. (2010) takes two thirds of the time. Sums
are also the same on every number of cores.

A number of threads that the environment states is left alone, by every road.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import threadpool_limits

_DEFAULTS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# Libraries that start threads as soon as they are loaded, which bywire never uses: numexpr beside
# pandas, and the allocator of pyarrow. A process with threads cannot be copied.
_IDLE_THREADS = {
    "NUMEXPR_NUM_THREADS": "1",
    "JE_ARROW_MALLOC_CONF": "background_thread:false",
}
VARIABLES = (*_DEFAULTS, "OMP_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""environment variables by which a user chooses"""


def one_thread_variables() -> dict[str, str]:
    """Environment variables of a child process whose libraries start no threads of their own."""
    return {**dict.fromkeys(_DEFAULTS, "1"), "OMP_NUM_THREADS": "1", **_IDLE_THREADS}


def keep_one_thread() -> None:
    """Have this process of ours compute on one thread, whether or not its libraries are loaded."""
    os.environ.update({k: v for k, v in _IDLE_THREADS.items() if k not in os.environ})
    if _is_chosen():
        return
    os.environ.update(dict.fromkeys(_DEFAULTS, "1"))
    if "numpy" in sys.modules:
        from threadpoolctl import threadpool_limits

        threadpool_limits(1, "blas")


@contextmanager
def on_one_thread() -> Iterator[None]:
    """Compute on one thread in this block, in a process that is somebody else's.

    Blocks may overlap, also in several threads: the last that ends gives back what there was.
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
    """Return whether the environment says how many threads there are."""
    return any(os.environ.get(name) for name in VARIABLES)


class _Limited:
    """What is limited for as long as somebody wants it to be."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._count = 0
        self._limits: threadpool_limits | None = None

    def begin(self) -> None:
        """Limit, unless that is done."""
        with self._lock:
            if self._limits is None:
                import scipy.linalg  # noqa: F401  has a BLAS of its own, which must be there to be told
                from threadpoolctl import threadpool_limits

                self._limits = threadpool_limits(1, "blas")
            self._count += 1

    def end(self) -> None:
        """Give back what there was, unless somebody still wants it."""
        with self._lock:
            self._count -= 1
            if self._count == 0 and self._limits is not None:
                self._limits.restore_original_limits()
                self._limits = None


_limited = _Limited()
