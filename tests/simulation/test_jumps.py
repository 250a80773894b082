"""What jumps with a state is nonlinear in it, though no derivative tells."""

from __future__ import annotations

import casadi as ca
import pytest

from bywire.simulation.symbols import nonlinear

X, P = ca.SX.sym("x", 2), ca.SX.sym("p")


@pytest.mark.parametrize(
    ("expression", "wanted"),
    [
        (ca.if_else(X[1] > P, 1.0, -1.0) + X[0], [False, True]),
        (P * ca.floor(X[0] / P) + 2.0 * X[1], [True, False]),
        (ca.sign(X[0]) * P, [True, False]),
        (P * X[0] + ca.floor(P) * X[1], [False, False]),
        (ca.fmax(X[0] - P, 0.0), [True, False]),
        (ca.SX(3.0), [False, False]),
    ],
)
def test_jumps_are_nonlinear(expression: ca.SX, wanted: list[bool]) -> None:
    assert nonlinear(expression, X) == wanted
