"""What Roberts et al. (2003) state of the moments and powers of their Figs. 7 to 9.

Moments that are held, reached or followed have the tolerance by which they are judged, as a band.
"""

from __future__ import annotations

from bywire.brakes.wedge.paper.statements import FILE

LEVELS, FIGURES = FILE.levels(), FILE.figures()
