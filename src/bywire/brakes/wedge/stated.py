"""Moments and powers that Roberts et al. (2003) state for their Figs. 7 to 9.

Moments that are held, reached or followed have a band: the tolerance of the comparison.
"""

from __future__ import annotations

from bywire.brakes.wedge.paper.statements import FILE

LEVELS, FIGURES = FILE.levels(), FILE.figures()
