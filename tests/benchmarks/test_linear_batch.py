"""Many operating points at once: as one by one."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.linear_batch import linearize_many
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.loop import LOOPS
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError, UnknownNameError

NAMES = {"moment": (("i_1_ref", "i_2_ref"), ("y_M", "F_N")), "pressure": (("duty",), ("p_mc", "i"))}


@pytest.mark.parametrize(("name", "values"), [("moment", (100.0, 500.0)), ("pressure", (5e5, 3e6))])
def test_every_point_is_that_of_linearize(name, values) -> None:
    loop = LOOPS.find(name)
    inputs, outputs = NAMES[name]
    points = [loop.point(parameters(main_set(loop.assembly)), value) for value in values]
    model, par = points[0].model, points[0].par
    states, memories = (np.array([p.state for p in points]), np.array([p.memory for p in points]))
    found = linearize_many(model, par, states, memories, inputs=inputs, outputs=outputs)
    for k, p in enumerate(points):
        one = linearize(model, par, p.state, p.memory, inputs=inputs, outputs=outputs)
        for part in ("A", "B", "C", "D", "rate"):
            exact = getattr(one, part)
            size = max(np.abs(exact).max(), 1.0)
            np.testing.assert_allclose(getattr(found, part)[k], exact, rtol=1e-9, atol=1e-12 * size)
    if name == "pressure":  # its stiffness grows with the pressure
        assert not np.allclose(found.A[0], found.A[1], rtol=1e-3)


def test_bad_requests() -> None:
    p = LOOPS.find("moment").point(parameters("roberts2003"), 200.0)
    one, held = np.array([p.state]), np.array([p.memory])
    with pytest.raises(UnknownNameError, match="i_1_ref"):
        linearize_many(p.model, p.par, one, held, inputs=("i1_ref",), outputs=())
    with pytest.raises(ParameterError, match="shapes"):
        linearize_many(p.model, p.par, one[:, 1:], held, inputs=(), outputs=())
