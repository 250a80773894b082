"""The regularized plant as CasADi functions, for peers that Python calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.motorcycle.problem import rates
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.typing import Array


@dataclass(frozen=True)
class Plant:
    """The regularized plant as expressions: scaled state, duty cycle, dz/dt."""

    z: Any
    duty: Any
    rate: Any


def plant(par: MotorcycleParameters, width: float) -> Plant:
    """Return the regularized plant with parameter values as constants."""
    z, duty = ca.SX.sym("z", len(MotorcycleBrake.State._fields)), ca.SX.sym("duty")
    return Plant(z, duty, ca.vertcat(*rates(z, duty, par, width)))


def slope_and_jacobian(par: MotorcycleParameters, width: float) -> tuple[Buffered, Buffered]:
    """Return the functions ``(z, duty) -> dz/dt`` and its derivative by z."""
    p = plant(par, width)
    slope = ca.Function("slope", [p.z, p.duty], [ca.densify(p.rate)])
    derivative = ca.densify(ca.jacobian(p.rate, p.z))
    return Buffered(slope), Buffered(ca.Function("derivative", [p.z, p.duty], [derivative]))


class Buffered:
    """A CasADi function on fixed arrays, without conversion costs.

    Parameters
    ----------
    function
        Function with dense arguments and one dense result.
    """

    def __init__(self, function: Any) -> None:
        self._buffer, self._trigger = function.buffer()
        self._inputs: list[Array] = [np.zeros(function.numel_in(k)) for k in range(function.n_in())]
        rows, columns = function.size_out(0)
        self._output: Array = np.zeros((columns, rows))  # CasADi stores columns
        for k, array in enumerate(self._inputs):
            self._buffer.set_arg(k, array.data)
        self._buffer.set_res(0, self._output.data)

    def __call__(self, *arguments: Array | float) -> Array:
        """Return a copy of the result, a vector if it has one column, otherwise a matrix."""
        for array, argument in zip(self._inputs, arguments, strict=True):
            array[:] = argument
        self._trigger()
        return self._output[0].copy() if len(self._output) == 1 else self._output.T.copy()
