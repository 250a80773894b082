"""A CasADi function through its buffers, which skip the conversion of arguments and results."""

from __future__ import annotations

from typing import Any

import numpy as np

from bywire.core.typing import Array


class BufferedCall:
    """A function that is called many times, by one caller at a time.

    Parameters
    ----------
    function
        CasADi function, of dense arguments and results.
    """

    def __init__(self, function: Any) -> None:
        self._buffer, self._trigger = function.buffer()
        self._inputs = [np.zeros(function.nnz_in(k)) for k in range(function.n_in())]
        self._outputs = [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
        for k, array in enumerate(self._inputs):
            self._buffer.set_arg(k, memoryview(array.data))
        for k, array in enumerate(self._outputs):
            self._buffer.set_res(k, memoryview(array.data))

    def __call__(self, *arguments: Array) -> list[Array]:
        """Return the results, column by column; the next call overwrites them."""
        for own, given in zip(self._inputs, arguments, strict=True):
            own[:] = given
        self._trigger()
        return self._outputs
