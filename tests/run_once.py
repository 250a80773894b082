"""Runs whose error from the step nobody asks for: a third of the substeps."""

from __future__ import annotations

from functools import partial

import bywire

run_once = partial(bywire.run, estimate_error=False)
