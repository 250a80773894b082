"""Pressures and currents stated by Dardanelli et al. (2010): Figs. 3 and 6, and section 6."""

from __future__ import annotations

from bywire.brakes.motorcycle.paper.facts import FILE

LEVELS, FIGURES = FILE.levels(), FILE.figures()
