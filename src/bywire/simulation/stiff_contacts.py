"""Whether the step resolves the contacts: stiff, lightly damped ones give wrong rebounds silently.

Contact begins and ends with a substep, each time a little early or late. For a contact without
damping that swings at omega on its bodies, the rebound is then up to 3 % faster or slower than the
approach at h omega = 0.5, 11 % at 1, 25 % at 1.5, and 2.2 times faster at 4, though every substep
settles. Damping of about half the critical one or more keeps it bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.simulation.symbols import SX, column, depends, scalars, symbol_tuple

SAFE, DAMPED = 1.0, 0.5  # h omega, and damping ratio
# What a contact gives may bend with its force: then every slope counts, not only that at the start.
LOADS = (0.0, *(10.0 ** (0.5 * k) for k in range(-6, 15)))  # N or N m


def contact_jacobians(model: Model, par: ParameterSet, x: Any, m: Any, p: Any) -> Any:
    """Return the function (x, m, p) -> Jacobians of dx/dt, contacts open and all closed.

    Where the balance is not linear in the contact forces, closed at each of ``LOADS``.
    """
    groups = [C for C in model.compliance(par) if C]
    K = ca.diagcat(*(_stiffness(C) for C in groups)) if groups else SX(0, 0)
    force = SX.sym("contact_", K.shape[0])
    state = symbol_tuple(model.State, x)
    f = column(model.balance(state, state, symbol_tuple(model.Memory, m), par, scalars(force)))
    gap = column([d for group in model.gap(state, state, par) for d in group])
    rate = f / column(model.mass(state, par))
    opened = ca.substitute(ca.jacobian(rate, x), force, SX.zeros(force.shape[0]))
    through = ca.jacobian(rate, force) @ K @ ca.jacobian(gap, x)
    loads = LOADS if depends(through, force) else LOADS[:1]
    closed = [opened + ca.substitute(through, force, load * SX.ones(force.shape)) for load in loads]
    return ca.Function("contact_jacobians", [x, m, p], [opened, *closed])


def _stiffness(C: Any) -> Any:
    return ca.inv(SX(ca.vertcat(*(ca.horzcat(*map(SX, row)) for row in C))))


def unresolved(
    opened: NDArray[np.float64], closed: Sequence[NDArray[np.float64]], step: float
) -> list[str]:
    """Return what is wrong with a step for the closed contacts of each case; empty for nothing.

    Parameters
    ----------
    opened, closed
        Jacobians of dx/dt [1/s], shape (cases, nx, nx) each, closed at one load or several.
    step
        Substep [s].
    """
    texts = [""] * len(opened)
    for J in closed:
        # Without contacts nothing changes by closing them, and nothing need be decomposed.
        changed = (opened != J).any((1, 2)) & np.isfinite(opened + J).all((1, 2))
        cases = [k for k in np.flatnonzero(changed) if not texts[k]]
        for k, text in zip(cases, _too_fast(opened[cases], J[cases], step), strict=True):
            texts[k] = text
    return texts


def _too_fast(opened: NDArray[np.float64], closed: NDArray[np.float64], step: float) -> list[str]:
    modes = np.linalg.eigvals(closed)
    omega = np.abs(modes)
    likely = (modes.imag != 0.0) & (-modes.real < DAMPED * omega) & (step * omega > SAFE)
    texts = [""] * len(modes)
    for k in np.flatnonzero(likely.any(axis=1)):
        fastest = np.abs(np.linalg.eigvals(opened[k]).imag).max(initial=0.0)
        swings = likely[k] & (np.abs(modes[k].imag) > 1.2 * fastest)
        if swings.any():
            swinging = omega[k][swings][0]
            texts[k] = (
                f"a closed contact swings at {swinging / (2 * np.pi):.4g} Hz, too fast for steps "
                f"of {step * 1e6:g} us: rebounds may be wrong; take steps of at most "
                f"{SAFE / swinging * 1e6:.2g} us, a softer contact, or more damping"
            )
    return texts
