"""What is said of measured signals whose signs do not fit together."""

from __future__ import annotations

from bywire.core.errors import ParameterError


def wrong_sign(one: str, other: str, evidence: str) -> ParameterError:
    """Return the refusal of two signals of which one has the wrong sign.

    Parameters
    ----------
    one, other
        Signals, in words.
    evidence
        What shows it, with its value.
    """
    return ParameterError(
        f"{one} goes against {other} ({evidence}): one of the two has the wrong sign; "
        "write sign = -1 for it in the map"
    )
