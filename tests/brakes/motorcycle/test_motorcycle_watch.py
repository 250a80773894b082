"""What the motorcycle brake says of a recording: which of many cases need be asked."""

from __future__ import annotations

import numpy as np

from bywire.bench.recording import Rows
from bywire.brakes.motorcycle import watch
from bywire.core.catalog import PARAMETER_SETS


def test_cases_that_are_not_asked_have_nothing_to_say():
    """Free, on the far stop for a while, pulled against the near one, and off it at the end."""
    force = np.zeros((4, 9))
    force[1, 3:5], force[2, -1], force[3, 2:5] = 40.0, -60.0, -60.0
    signals = {"F_stop": force, "at_stop": np.sign(force), "i": np.full(force.shape, -1.0)}
    signals["p_pd"] = np.full(force.shape, 2e4)
    rows = Rows(np.arange(9.0), signals, {name: {} for name in signals})
    par = PARAMETER_SETS.find("dardanelli2010").parameters()
    said = [bool(watch.watch(rows.case(k), par)) for k in range(4)]
    assert watch.may_warn(rows) == np.flatnonzero(said).tolist() == [1, 2]
