"""Linear forms in the states: sums whose coefficients are computed once and not every substep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.simulation.symbols import SX, depends


@dataclass(frozen=True)
class Form:
    """``sum_j coefficient_j x_j + rest``.

    The coefficients do not change from substep to substep, so that the kernel hoists them and
    the sum takes one product per state.

    Parameters
    ----------
    coefficients
        By index of the state.
    rest
        Everything else.
    """

    coefficients: dict[int, Any]
    rest: Any

    def value(self, x: Any) -> Any:
        """Return the number that the form stands for at the states x."""
        total = self.rest
        for index, coefficient in self.coefficients.items():
            total = total + coefficient * x[index]
        return total

    def plus(self, factor: Any, other: Form, x: Any, changing: Any) -> Form:
        """Return this form plus a factor times another one."""
        if depends(SX(factor), changing):
            return Form(self.coefficients, self.rest + factor * other.value(x))
        coefficients = dict(self.coefficients)
        for index, coefficient in other.coefficients.items():
            coefficients[index] = coefficients.get(index, SX(0)) + factor * coefficient
        return Form(coefficients, self.rest + factor * other.rest)

    def times(self, factor: Any, x: Any, changing: Any) -> Form:
        """Return a factor times this form."""
        return Form({}, SX(0)).plus(factor, self, x, changing)


def forms(f: Any, J: Any, x: Any, changing: Any, curved: list[bool]) -> list[Form]:
    """Return the rows of f as forms.

    Parameters
    ----------
    f
        Rows, as functions of the symbols x; shape (n,).
    J
        Jacobian of f with respect to x.
    changing
        Symbols that change from substep to substep.
    curved
        For each row whether it is nonlinear in x: it stays as it is.
    """
    at_zero = ca.substitute(f, x, SX.zeros(x.shape[0]))
    rows = []
    for i in range(f.shape[0]):
        if curved[i]:
            rows.append(Form({}, f[i]))
            continue
        fixed, moving = {}, at_zero[i]
        for j in range(x.shape[0]):
            if J[i, j].is_zero():
                continue
            if depends(J[i, j], changing):
                moving = moving + J[i, j] * x[j]
            else:
                fixed[j] = J[i, j]
        rows.append(Form(fixed, moving))
    return rows
