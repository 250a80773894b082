"""What a simulated measurement is made of, by the names that estimates have."""

from __future__ import annotations

from typing import Any

from bywire.identification.method import Method


def put_in(method: Method, par: Any, options: Any) -> dict[str, float]:
    """Return the true values of a method's simulated measurements, SI, by label.

    Parameters
    ----------
    method
        Simulates with ``method.synthetic``.
    par, options
        Its parameters, None for a method of any assembly, and its options.

    Raises
    ------
    ParameterError
        When what is simulated has no true values of what the method estimates.
    """
    truth: dict[str, float] = {} if par is None else par.leaves()
    return truth if method.truth is None else {**truth, **method.truth(par, options)}
