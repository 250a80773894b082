"""How far brakes are from the statements, in tolerances, and what these tell of a brake."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bywire.brakes.motorcycle.paper.measured.experiments import computed
from bywire.brakes.motorcycle.paper.measured.statements import STATEMENTS
from bywire.brakes.motorcycle.paper.measured.unknowns import brake, unknowns
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.errors import ParameterError, SolverError
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate, Part
from bywire.identification.least_squares import Loss, Problem, estimate, influence, rho
from bywire.identification.unknown import Unknown, moved

Par = MotorcycleParameters

LOSS: Loss = "soft_l1"
"""how large residuals count: the statements contradict each other, and by squares the one that is
furthest off would decide over all others"""
STEP = 0.01
"""of the differences, as a share of an unknown's scale: beyond it the gain bends, below it stick
and slip show"""
PARTS = tuple(Part(s.name, "", 1, s.fact.unit, s.tolerance) for s in STATEMENTS)
"""every residual by itself"""

_RESOLVED = 1e-4  # of the misfit: less is the roughness that stick and slip leave


def predicted(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return what each brake gives for every statement, by its name, in its unit.

    Parameters
    ----------
    brakes
        Parameter sets of one structure, which differ in numbers alone.

    Raises
    ------
    SolverError
        When a trajectory leaves the numbers.
    """
    rows = computed(brakes)
    for par, row in zip(brakes, rows, strict=True):
        row |= {f"table3.{name}": float(value) for name, value in par.seal.flat().items()}
    return [{s.name: row[s.name] for s in STATEMENTS} for row in rows]


def residuals(brakes: Sequence[Par]) -> Array:
    """Return computed less stated over the tolerance, shape (brakes, statements)."""
    return np.array([[s.residual(row[s.name]) for s in STATEMENTS] for row in predicted(brakes)])


def problem(free: tuple[Unknown, ...] | None = None, step: float = STEP) -> Problem:
    """Return the misfit as a function of the free parameters.

    Derivatives are differences to both sides, within the bounds; all brakes that they take are
    computed side by side.

    Parameters
    ----------
    free
        Unknowns; all of them by default.
    step
        Of the differences, as a share of each unknown's scale.
    """
    free = unknowns() if free is None else free
    last: dict[bytes, tuple[Array, Array]] = {}  # what is held back at its value costs no runs

    def evaluate(values: Array) -> tuple[Array, Array]:
        if (key := values.tobytes()) not in last:
            found = fresh(values)
            last.clear()
            last[key] = found
        return last[key]

    def fresh(values: Array) -> tuple[Array, Array]:
        try:
            r, lower, upper, ends = around(free, values, step)
        except ParameterError as error:  # a trial step too far: a shorter one follows
            raise SolverError(str(error)) from error
        return r, slopes(values, r, lower, upper, ends)

    return Problem(free, evaluate, parts=PARTS, resolved=_RESOLVED)


def slopes(values: Array, r: Array, lower: Array, upper: Array, ends: tuple[Array, Array]) -> Array:
    """Return how residuals change, shape (statements, unknowns): by both sides.

    Where one side does not have what a statement is of, such as a loop of a piston that sticks, the
    other side tells alone.
    """
    sides = []
    for side, end in zip((lower, upper), ends, strict=True):
        known = np.isfinite(side)
        at = np.where(known, end[:, None], values[:, None])
        sides.append((np.where(known, side, r), at))
    (below, low), (above, high) = sides
    with np.errstate(invalid="ignore"):  # where no side does: it is not defined
        return np.asarray(((above - below) / (high - low)).T)


def around(
    free: Sequence[Unknown], values: Array, step: float
) -> tuple[Array, Array, Array, tuple[Array, Array]]:
    """Return the residuals, those below and above in each unknown, and its values there."""
    size = step * np.array([u.scale for u in free])
    low, high = (np.array([getattr(u, end) for u in free]) for end in ("low", "high"))
    ends = np.maximum(values - size, low), np.minimum(values + size, high)
    rows = [values]
    for end in ends:
        rows += list(np.where(np.eye(values.size, dtype=bool), end, values))
    r = residuals([brake(_named(free, row)) for row in rows])
    lower, upper = r[1 : 1 + values.size], r[1 + values.size :]
    return r[0], lower, upper, ends


def _named(free: Sequence[Unknown], values: Array) -> Mapping[str, float]:
    return {u.name: float(v) for u, v in zip(free, values, strict=True)}


def misfit(r: Array) -> float:
    """Return what is minimized, half the sum of the losses, by residuals in tolerances."""
    return 0.5 * float(rho(r**2, LOSS)[0].sum())


def sized(values: Array) -> tuple[Unknown, ...]:
    """Return the unknowns with the larger of prior and estimate as their usual magnitude."""
    return tuple(
        replace(u, scale=max(u.scale, abs(float(v))))
        for u, v in zip(unknowns(), values, strict=True)
    )


# --- What the statements tell of a brake, taken for the one that explains them best


def appraised(par: Par) -> Appraisal:
    """Return what the statements tell of a brake's free parameters, taken for the best ones.

    What they do not tell counts as kept where the brake has it.

    Raises
    ------
    SolverError
        When a trajectory leaves the numbers.
    """
    values = np.array([par.leaves()[u.name] for u in unknowns()])
    free = moved(sized(values), values)
    r, lower, upper, ends = around(free, values, STEP)
    J = slopes(values, r, lower, upper, ends)
    best = estimate(Problem(free, lambda _: (r, J), parts=PARTS), LOSS, values, search=False)
    told = [[u.name for u in free].index(name) for name in best.names]
    scale = np.array([u.scale for u in best.unknowns])
    return Appraisal(best, r, J[:, told] * scale, np.stack((lower[told], upper[told])))


@dataclass(frozen=True)
class Appraisal:
    """A brake's free parameters as an estimate.

    Parameters
    ----------
    estimate
        Those that the statements tell, with intervals, and those that they do not.
    residuals
        In tolerances, shape (statements,).
    jacobian
        Of the residuals by what is told, per unknown's scale, shape (statements, p).
    beside
        Residuals with each of them 1 % of its scale lower, and higher, shape (2, p, statements).
    """

    estimate: Estimate
    residuals: Array
    jacobian: Array
    beside: Array

    @property
    def computed(self) -> dict[str, float]:
        """What the brake gives for every statement, by its name, in its unit."""
        rows = zip(STATEMENTS, self.residuals, strict=True)
        return {s.name: s.fact.value + s.tolerance * float(r) for s, r in rows}

    @property
    def misfit(self) -> float:
        """What is minimized: half the sum of the losses."""
        return misfit(self.residuals)

    def gain(self) -> float:
        """Return the largest share of the misfit that moving one parameter by 1 % would gain.

        At a minimum there is none but the roughness that stick and slip leave.
        """
        misfits = [misfit(r) for side in self.beside for r in side]
        return 1.0 - float(np.nanmin(misfits)) / self.misfit

    def tellers(self, name: str, most: int = 3) -> tuple[str, ...]:
        """Return the statements that move a parameter most when they move by their tolerance.

        Parameters
        ----------
        name
            Of the parameter.
        most
            Statements at most; those of less than a third of the first are left out.
        """
        _, steep = influence(self.residuals, LOSS)
        weighed = self.jacobian * steep[:, None]
        moved = np.linalg.pinv(self.jacobian.T @ weighed) @ weighed.T
        row = np.abs(moved[self.estimate.names.index(name)])
        order = [k for k in np.argsort(-row)[:most] if row[k] > row.max() / 3.0]
        return tuple(STATEMENTS[k].name for k in order)
