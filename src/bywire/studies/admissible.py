"""What varies stays admissible: a study would silently answer another question."""

from __future__ import annotations

from bywire.core.errors import ParameterError
from bywire.core.leaf import Leaf
from bywire.studies.distribution import NEVER, Distribution


def require_admissible(name: str, made: Distribution, leaf: Leaf) -> None:
    """Refuse what leaves the admissible range of its number.

    Parameters
    ----------
    name
        Dotted name of the number.
    made, leaf
        How it varies, and what is known about it.

    Raises
    ------
    ParameterError
        With what is admissible, and the probability of what is not.
    """
    if made.below is None or made.above is None:
        beyond = float(
            made.low < leaf.low or (leaf.low_open and made.low == leaf.low)
            or made.high > leaf.high or (leaf.high_open and made.high == leaf.high)
        )  # fmt: skip
    else:
        beyond = float(made.below(leaf.low) + made.above(leaf.high))
    if beyond > NEVER:
        raise ParameterError(
            f"[vary] {name}: {made.text} leaves what is admissible, {leaf.range_text}"
            + (f", with a probability of {beyond:.2g}" if beyond < 1.0 else "")
            + ": give 'low' and 'high' to a normal distribution, or other ends"
        )
