"""Pressures at which the motorcycle brake's loops are linearized."""

from __future__ import annotations

from bywire.core.errors import ParameterError


def require_pressed(p: float) -> None:
    """Refuse a brake that is released: its piston just touches its stop and has no linear model.

    Parameters
    ----------
    p
        Pressure of the operating point [Pa].

    Raises
    ------
    ParameterError
        When it is 0.
    """
    if p == 0.0:
        raise ParameterError(
            "pressure = 0 bar is no operating point: the piston just touches its stop; it must be "
            "> 0 bar, for instance '5 bar'"
        )
