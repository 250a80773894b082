"""What the statements tell of a brake, taken for the one that explains them best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bywire.brakes.motorcycle.paper.measured.misfit import (
    LOSS,
    PARTS,
    STEP,
    around,
    misfit,
    sized,
    slopes,
)
from bywire.brakes.motorcycle.paper.measured.statements import STATEMENTS
from bywire.brakes.motorcycle.paper.measured.unknowns import unknowns
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate, influence
from bywire.identification.unknown import moved

Par = MotorcycleParameters


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
