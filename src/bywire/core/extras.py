"""Optional libraries: how to install the extra that brings them."""

from __future__ import annotations


def how_to_install(extra: str) -> str:
    """Return the commands that install an extra, for an installed package and for a clone.

    Examples
    --------
    >>> how_to_install("measurements")
    "pip install 'bywire[measurements]', or in a clone pip install -e '.[measurements]'"
    """
    return f"pip install 'bywire[{extra}]', or in a clone pip install -e '.[{extra}]'"
