"""Moments and powers stated by Roberts et al. (2003) for their Figs. 7 to 9.

Held, reached and tracked moments have a band: the tolerance of the comparison.
"""

from __future__ import annotations

from bywire.brakes.wedge.paper.statements import FILE

LEVELS, FIGURES = FILE.levels(), FILE.figures()
