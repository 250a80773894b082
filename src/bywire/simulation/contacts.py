"""Unilateral contacts: a small complementarity problem for the closed contacts and their forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import SolverError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.units import shown
from bywire.simulation.symbols import SX, column, depends, nonlinear, scalars, symbol_tuple


def active_stiffness(C: Any, d: Any) -> Any:
    """Return the stiffness K of a contact group's active subset, shape (n, n), with forces K d.

    Rows and columns of inactive contacts are zero. The active subset S solves the problem
    F = C_SS^-1 d_S >= 0 in S and C F - d >= 0 outside S. The function chooses the subset with the
    largest minimum slack. Choosing by "slack > 0" would lose all force in exact ties. Slacks of
    inactive contacts are divided by C_kk, so they have the unit of a force.

    Parameters
    ----------
    C
        Compliance matrix, shape (n, n), positive definite.
    d
        Overlaps, shape (n,).
    """
    n = d.shape[0]
    if n == 1:
        pressed = d[0] > 0
        return ca.if_else(pressed, 1.0 / C, 0)
    cases = []
    for subset in (s for size in range(n + 1) for s in combinations(range(n), size)):
        K = _embedded_inverse(C, subset)
        F = K @ d
        outside = C @ F - d
        slacks = [F[k] if k in subset else outside[k] / C[k, k] for k in range(n)]
        slack = slacks[0]
        for other in slacks[1:]:
            slack = ca.fmin(slack, other)
        cases.append((slack, ca.vec(ca.densify(K))))
    return ca.reshape(_largest(cases), n, n)


def _embedded_inverse(C: Any, subset: tuple[int, ...]) -> Any:
    n = C.shape[0]
    K = SX.zeros(n, n)
    if subset:
        rows = list(subset)
        inverse = _inverse(C[rows, rows])
        for a, i in enumerate(rows):
            for b, j in enumerate(rows):
                K[i, j] = inverse[a, b]
    return K


def _inverse(M: Any) -> Any:
    """Return the inverse by cofactors, which needs no branches and suits small groups."""
    n = M.shape[0]
    if n == 1:
        return 1.0 / M
    adjugate = SX.zeros(n, n)
    for i in range(n):
        for j in range(n):
            rows = [r for r in range(n) if r != j]
            columns = [c for c in range(n) if c != i]
            adjugate[i, j] = (-1) ** (i + j) * ca.det(M[rows, columns])
    determinant = sum((M[0, k] * adjugate[k, 0] for k in range(n)), SX(0))
    return adjugate / determinant


def _largest(cases: list[tuple[Any, Any]]) -> Any:
    best_slack, best = cases[0]
    for slack, value in cases[1:]:
        better = slack > best_slack
        best = ca.if_else(better, value, best)
        best_slack = ca.fmax(slack, best_slack)
    return best


# --- A model's contacts: overlaps, stiffness of closed contacts, consistency


def contact_forces(model: Model, par: ParameterSet, x: Any) -> Any:
    """Return the forces of all contacts at the time of a recorded row.

    A substep's forces are valid at its midpoint, so they would be half a substep old.
    """
    overlap = gaps(model, par, x, x)
    return stiffness(model, par, overlap, exact=True) @ overlap


def _groups(model: Model, par: ParameterSet, exact: bool) -> list[tuple[Any, slice, bool]]:
    """Return each group's compliances, its slice, and whether the pass assumes that it is open."""
    matrices, groups, at = model.compliance(par), [], 0
    rarely = model.usually_open or (False,) * len(matrices)
    for C, rare in zip(matrices, rarely, strict=True):
        if not C:
            continue
        rows = SX(ca.vertcat(*(ca.horzcat(*map(SX, row)) for row in C)))
        groups.append((rows, slice(at, at + len(C)), rare and not exact))
        at += len(C)
    return groups


def stiffness(model: Model, par: ParameterSet, d: Any, exact: bool) -> Any:
    """Return the block-diagonal stiffness of the active subsets of all groups, shape (n, n).

    Parameters
    ----------
    d
        Overlaps of all n contacts, shape (n,).
    exact
        If False, contacts that are usually open are assumed to be open.
    """
    blocks = [
        SX(*rows.shape) if is_open else active_stiffness(rows, d[place])
        for rows, place, is_open in _groups(model, par, exact)
    ]
    return ca.diagcat(*blocks) if blocks else SX(0, 0)


def gaps(model: Model, par: ParameterSet, x: Any, xe: Any) -> Any:
    """Return all overlaps at a state; see `overlaps`."""
    return overlaps(model, par)(x, xe)


def overlaps(model: Model, par: ParameterSet) -> Callable[[Any, Any], Any]:
    """Return all overlaps as affine functions of x whose coefficients can be hoisted.

    Returns
    -------
    callable
        Function of the state and of the state at which geometry is evaluated, shape (nx,) each. It
        returns the overlaps, shape (n,).

    Raises
    ------
    SolverError
        When the overlaps are not affine in the state.
    """
    n = len(model.State._fields)
    state, fixed = SX.sym("x_", n), SX.sym("xe_", n)
    groups = model.gap(symbol_tuple(model.State, state), symbol_tuple(model.State, fixed), par)
    gap = column([d for group in groups for d in group])
    if any(nonlinear(gap, state)):
        raise SolverError(
            f"{model.name}: the overlaps of contacts must be affine in the state",
            name="overlaps",
            valid="affine in the state",
        )
    slope = ca.jacobian(gap, state)
    rest = ca.substitute(gap, state, SX.zeros(n))

    def at(x: Any, xe: Any) -> Any:
        moved, steep = ca.substitute([rest, slope], [fixed], [xe])
        return steep @ x + moved

    return at


def violations(model: Model, par: ParameterSet, d: Any, F: Any, exact: bool) -> list[Any]:
    """Return values that are positive where a contact set contradicts the computed midpoint.

    If all forces in the assumed set push, and no overlap remains outside the set, the forces are
    the unique solution. This check is cheaper than choosing the set again.

    Parameters
    ----------
    d, F
        Overlaps and forces of all contacts, shape (n,) each.
    exact
        See `stiffness`.
    """
    violated: list[Any] = []
    for rows, place, is_open in _groups(model, par, exact):
        overlap, force = d[place], ca.densify(F[place])
        closed = rows @ force
        for k in range(overlap.shape[0]):
            lack = overlap[k] - closed[k]
            # If a force pushes, the remaining overlap is zero to within rounding.
            wrong = ca.if_else(force[k] > 0, 0, ca.fmax(lack, -force[k]))
            violated.append(overlap[k] if is_open else wrong)
    return violated


# --- Resolution of contacts: stiff, lightly damped contacts rebound incorrectly at long steps
# Contact begins and ends at the boundary of a substep, slightly early or late. Consider an undamped
# contact that oscillates at omega with its bodies. Its rebound is up to 3 % faster or
# slower than the approach at h omega = 0.5, 11 % at 1, 25 % at 1.5, and 2.2 times faster at 4,
# although every substep settles. A damping ratio of at least about 0.5 keeps the error bounded.

SAFE, DAMPED = 1.0, 0.5  # h omega, and damping ratio
# A contact's compliance may depend on its force, so every slope counts, not only the first.
LOADS = (0.0, *(10.0 ** (0.5 * k) for k in range(-6, 15)))  # N or N m


def contact_jacobians(model: Model, par: ParameterSet, x: Any, m: Any, p: Any) -> Any:
    """Return the function (x, m, p) -> Jacobians of dx/dt with all contacts open and all closed.

    If the balance is nonlinear in the contact forces, there is one Jacobian for each of ``LOADS``.
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
    """Return each case's warning on the step for closed contacts; empty if the step is fine.

    Parameters
    ----------
    opened, closed
        Jacobians of dx/dt [1/s], shape (cases, nx, nx) each, closed at one load or several.
    step
        Substep [s].
    """
    texts = [""] * len(opened)
    for J in closed:
        # Without contacts, both Jacobians are equal, and no decomposition is necessary.
        changed = (opened != J).any((1, 2)) & np.isfinite(opened + J).all((1, 2))
        doubtful = np.flatnonzero(changed)
        doubtful = doubtful[~_are_surely_resolved(J[doubtful], step)]
        cases = [k for k in doubtful if not texts[k]]
        if cases:
            for k, text in zip(cases, _too_fast(opened[cases], J[cases], step), strict=True):
                texts[k] = text
    return texts


_WORST = 1e9  # condition number of eigenvectors beyond which the disks would say nothing


def _are_surely_resolved(closed: NDArray[np.float64], step: float) -> NDArray[np.bool_]:
    """Return which Jacobians have only slow or well damped modes, without their eigenvalues.

    With the eigenvectors of the first one as basis, the others are almost diagonal, and each
    eigenvalue is in one of Gershgorin's disks. This takes a fifth of the time of a decomposition.
    """
    if len(closed) < 2:
        return np.zeros(len(closed), dtype=bool)
    _, basis = np.linalg.eig(closed[0])
    condition = np.linalg.cond(basis)
    if not condition < _WORST:
        return np.zeros(len(closed), dtype=bool)
    turned = np.linalg.inv(basis) @ closed @ basis
    centers = np.diagonal(turned, axis1=1, axis2=2)
    rounding = 16.0 * np.finfo(float).eps * condition * np.abs(closed).sum(axis=(1, 2))
    radii = np.abs(turned).sum(axis=2) - np.abs(centers) + rounding[:, None]
    fastest = (np.abs(centers) + radii) * (1.0 + 1e-6)
    are_slow, are_damped = step * fastest <= SAFE, -centers.real - radii >= DAMPED * fastest
    return np.asarray((are_slow | are_damped).all(axis=1))


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
                f"a closed contact oscillates at {swinging / (2 * np.pi):.4g} Hz, too fast for "
                f"steps of {shown(step, 's', 'us')}, so rebounds may be wrong. Use steps of at "
                f"most {shown(SAFE / swinging, 's', 'us', 2)}, a softer contact, or more damping"
            )
    return texts
