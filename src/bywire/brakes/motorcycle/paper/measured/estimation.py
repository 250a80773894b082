"""All free parameters from all statements together: unknowns, misfit, search, uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bywire.brakes.motorcycle.paper.measured.statements import STATEMENTS, computed
from bywire.brakes.motorcycle.paper.runs import PRINTED, parameters
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.errors import ParameterError, SolverError
from bywire.core.parameters import leaf_fields
from bywire.core.typing import Array, Progress
from bywire.identification.estimate import Estimate, Part
from bywire.identification.least_squares import Loss, Problem, estimate, influence, rho, solve
from bywire.identification.multistart import search
from bywire.identification.unknown import Unknown, moved, scattered

Par = MotorcycleParameters

PRIOR = PRINTED
"""set of the starts, and of the parameters that no statement determines: Table 1 as printed"""
P_NOMINAL = 20e5
"""pressure [Pa] at which the piston stands at its nominal position, as in the other sets"""

_TENFOLD = "a tenth to ten times Table 1: beyond it is another brake"
_TABLE3 = "a fifth to five times Table 3"


@dataclass(frozen=True)
class _Free:
    """A free parameter: bounds [SI], their reason, and the magnitude where it may be zero."""

    low: float
    high: float
    reason: str
    scale: float = 0.0


FREE: Mapping[str, _Free] = {
    "master_cylinder.A_mc": _Free(0.4e-4, 3e-4, "bores of 7 to 20 mm"),
    "gear.eta_g": _Free(0.5, 1.0, "ball screw and gear; no machine returns more than its input"),
    "gear.J_mot": _Free(2e-6, 2e-4, "a motor of 20 to 80 mm"),
    "master_cylinder.k_damp": _Free(0.0, 2e5, "none to ten times Table 1"),
    "caliper.K_pd": _Free(1e5, 1e7, _TENFOLD),
    "fluid.V_air": _Free(
        0.0, 6e-7, "none to the largest volume that fits the nominal position", 1e-7
    ),
    "master_cylinder.s_mc": _Free(15.5e-3, 60e-3, "beyond the end stop; three times our choice"),
    "seal.T_pr": _Free(0.0, 3e-2, "none to Fig. 4's torque at low pressure"),
    "seal.f_cfr_p": _Free(3.2e-9, 8e-8, _TABLE3),
    "seal.f_cfr_n": _Free(1.08e-9, 2.7e-8, _TABLE3),
    "seal.k_brk_p": _Free(1.0, 13.0, "no less than Coulomb friction; five times Table 3"),
    "seal.k_brk_n": _Free(1.0, 11.5, "no less than Coulomb friction; five times Table 3"),
    "seal.c": _Free(1.0, 25.0, _TABLE3),
    "seal.mu_T": _Free(0.0, 2e-3, "none to the text's 1e-2 N m s/rad in place of Table 3's", 2e-7),
    "ecu.filter.zeta": _Free(0.3, 1.5, "second-order low-passes in use"),
}
"""parameters that are estimated together"""

TIED: Mapping[str, str] = {
    "ecu.est_par.T_pr": "seal.T_pr",
    "ecu.est_par.f_cfr_p": "seal.f_cfr_p",
    "ecu.est_par.k_brk_p": "seal.k_brk_p",
}
"""friction that the ECU assumes for the dither, and the parameter with the same value"""

HELD: Mapping[str, str] = {
    "gear.k_g": "acts only through A_mc k_g, k_damp k_g^2 and the chamber's volume, which A_mc, "
    "k_damp and s_mc cover",
    "gear.M_mc": "adds to the inertia, which J_mot covers",
    "motor.K_e": "acts through eta_g K_e, which eta_g covers, and hardly in the back-EMF",
    "caliper.A_pd": "acts only through A_pd^2/K_pd, which K_pd covers",
    "fluid.beta": "acts only through the chamber's volume over it, which s_mc covers",
    "pipeline.d_pl": "the misfit only falls as the pipeline gets wider, until its resistance is "
    "negligible and the misfit no longer depends on d_pl: the statements give a lower bound",
    "fluid.nu": "acts only through the pipeline's resistance, as d_pl does",
    "fluid.rho": "acts only through the pipeline's resistance, as d_pl does",
    "pipeline.L_pl": "acts only through the pipeline's resistance, as d_pl does",
    "pipeline.k_lf": "acts only through the pipeline's resistance, as d_pl does",
}
"""parameters that keep their value of Table 1, with the reason: most of them act only in a product
with a free one"""


def prior() -> Par:
    """Return the start of the search: Table 1 as printed, with the law of entrained air on."""
    return parameters(PRIOR).replace({"fluid.air": "entrained", "fluid.V_air": 0.0})


def unknowns() -> tuple[Unknown, ...]:
    """Return the free parameters as unknowns, within their bounds, from Table 1."""
    known, fields = prior().leaves(), leaf_fields(Par)
    return tuple(
        Unknown(
            name,
            known[name],
            free.low,
            free.high,
            free.scale or known[name],
            fields[name].unit.symbol,
        )
        for name, free in FREE.items()
    )


def brake(values: Mapping[str, float]) -> Par:
    """Return the brake with some of the free parameters changed, the others as in Table 1.

    The retracted end follows, so that the piston is at its nominal position at 20 bar, and so does
    the friction that the ECU assumes.

    Parameters
    ----------
    values
        By name, SI.

    Raises
    ------
    ParameterError
        When a value is out of range, or the stroke to 20 bar is longer than the nominal travel.
    """
    tied = {name: values[source] for name, source in TIED.items() if source in values}
    near = prior().replace({**values, **tied})
    nominal = near.master_cylinder.x_nominal
    x_rest = near.master_cylinder.x_rest
    for _ in range(
        20
    ):  # the travel hardly depends on the volume behind it: a few rounds are enough
        missing = nominal - travel_at(P_NOMINAL, near)
        x_rest += missing
        if not x_rest > 0.0:
            limit = f"< {nominal * 1e3:g} mm"
            raise ParameterError(
                f"the stroke to {P_NOMINAL / 1e5:g} bar must be {limit}, the nominal travel: "
                "reduce fluid.V_air, or raise caliper.K_pd or master_cylinder.A_mc",
                name="stroke",
                valid=limit,
            )
        near = near.replace({"master_cylinder.x_rest": x_rest})
        if abs(missing) < 1e-12:
            break
    return near


# --- The misfit

LOSS: Loss = "soft_l1"
"""weight of large residuals: the statements contradict each other, and with squares the largest
residual would dominate"""
_STEP = 0.01
"""step of the differences as a share of an unknown's scale: larger steps add the curvature of the
gain, smaller ones the roughness of stick-slip"""
_PARTS = tuple(Part(s.name, "", 1, s.fact.unit, s.tolerance) for s in STATEMENTS)
"""one part per residual"""

_RESOLVED = 1e-4  # of the misfit: smaller changes are roughness from stick-slip


def predicted(brakes: Sequence[Par]) -> list[dict[str, float]]:
    """Return each brake's counterpart of every statement, by the statement's name, in its unit.

    Parameters
    ----------
    brakes
        Parameter sets that differ only in numbers, not in choices.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    rows = computed(brakes)
    for par, row in zip(brakes, rows, strict=True):
        row |= {f"table3.{name}": float(value) for name, value in par.seal.flat().items()}
    return [{s.name: row[s.name] for s in STATEMENTS} for row in rows]


def residuals(brakes: Sequence[Par]) -> Array:
    """Return (computed - stated)/tolerance, shape (brakes, statements)."""
    return np.array([[s.residual(row[s.name]) for s in STATEMENTS] for row in predicted(brakes)])


def problem(free: tuple[Unknown, ...] | None = None) -> Problem:
    """Return the misfit as a function of the free parameters.

    Derivatives are central differences, one-sided at the bounds. All brakes that they need are
    computed side by side.

    Parameters
    ----------
    free
        Unknowns; all of them by default.
    """
    free = unknowns() if free is None else free
    last: dict[bytes, tuple[Array, Array]] = {}  # a fixed parameter needs no further runs

    def evaluate(values: Array) -> tuple[Array, Array]:
        if (key := values.tobytes()) not in last:
            result = simulated(values)
            last.clear()
            last[key] = result
        return last[key]

    def simulated(values: Array) -> tuple[Array, Array]:
        try:
            r, lower, upper, ends = _around(free, values)
        except (
            ParameterError
        ) as error:  # the trial step was too long: the search takes a shorter one
            raise SolverError(str(error)) from error
        return r, slopes(values, r, lower, upper, ends)

    return Problem(free, evaluate, parts=_PARTS, resolved=_RESOLVED)


def slopes(values: Array, r: Array, lower: Array, upper: Array, ends: tuple[Array, Array]) -> Array:
    """Return the derivatives of the residuals, shape (statements, unknowns), from both sides.

    Where a statement has no counterpart on one side, such as the area of a loop when the piston
    sticks, the derivative is one-sided.
    """
    sides = []
    for side, end in zip((lower, upper), ends, strict=True):
        is_defined = np.isfinite(side)
        at = np.where(is_defined, end[:, None], values[:, None])
        sides.append((np.where(is_defined, side, r), at))
    (below, low), (above, high) = sides
    with np.errstate(invalid="ignore"):  # undefined on both sides: 0/0, NaN
        return np.asarray(((above - below) / (high - low)).T)


def _around(
    free: Sequence[Unknown], values: Array
) -> tuple[Array, Array, Array, tuple[Array, Array]]:
    """Return the residuals here, one step below and above in each unknown, and these values."""
    size = _STEP * np.array([u.scale for u in free])
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
    """Return the cost of the fit: half the sum of the losses of residuals in tolerances."""
    return 0.5 * float(rho(r**2, LOSS)[0].sum())


def _sized(values: Array) -> tuple[Unknown, ...]:
    """Return the unknowns, each scaled by its prior or its estimate, whichever is larger."""
    return tuple(
        replace(u, scale=max(u.scale, abs(float(v))))
        for u, v in zip(unknowns(), values, strict=True)
    )


# --- Uncertainty of a brake that is assumed to be the best


def appraised(par: Par) -> Appraisal:
    """Return the uncertainty of a brake's free parameters, assumed to be the misfit's minimum.

    Parameters that the statements do not determine count as fixed at their values.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    values = np.array([par.leaves()[u.name] for u in unknowns()])
    free = moved(_sized(values), values)
    r, lower, upper, ends = _around(free, values)
    J = slopes(values, r, lower, upper, ends)
    best = estimate(Problem(free, lambda _: (r, J), parts=_PARTS), LOSS, values, search=False)
    determined = [[u.name for u in free].index(name) for name in best.names]
    scale = np.array([u.scale for u in best.unknowns])
    beside = np.stack((lower[determined], upper[determined]))
    return Appraisal(best, r, J[:, determined] * scale, beside)


@dataclass(frozen=True)
class Appraisal:
    """A brake's free parameters as an estimate.

    Parameters
    ----------
    estimate
        Parameters that the statements determine, p of them, with intervals, and the others.
    residuals
        In tolerances, shape (statements,).
    jacobian
        Of the residuals by the p parameters, each in its scale, shape (statements, p).
    beside
        Residuals with each parameter 1 % of its scale lower, and higher, shape (2, p, statements).
    """

    estimate: Estimate
    residuals: Array
    jacobian: Array
    beside: Array

    @property
    def computed(self) -> dict[str, float]:
        """The brake's counterpart of every statement, by the statement's name, in its unit."""
        rows = zip(STATEMENTS, self.residuals, strict=True)
        return {s.name: s.fact.value + s.tolerance * float(r) for s, r in rows}

    @property
    def misfit(self) -> float:
        """The cost: half the sum of the losses."""
        return misfit(self.residuals)

    def gain(self) -> float:
        """Return the misfit's largest relative reduction by a step of 1 % in one parameter.

        At a minimum only the roughness from stick-slip remains.
        """
        misfits = [misfit(r) for side in self.beside for r in side]
        return 1.0 - float(np.nanmin(misfits)) / self.misfit

    def deciding_statements(self, name: str, most: int = 3) -> tuple[str, ...]:
        """Return the statements whose shift by one tolerance moves a parameter most.

        Parameters
        ----------
        name
            Name of the parameter.
        most
            Largest number of statements; omits those with less than a third of the first.
        """
        _, steep = influence(self.residuals, LOSS)
        weighed = self.jacobian * steep[:, None]
        moved = np.linalg.pinv(self.jacobian.T @ weighed) @ weighed.T
        row = np.abs(moved[self.estimate.names.index(name)])
        order = [k for k in np.argsort(-row)[:most] if row[k] > row.max() / 3.0]
        return tuple(STATEMENTS[k].name for k in order)


# --- The search

_SPREAD = 0.3
"""largest distance of the other starts from Table 1, as a share of it"""

_ROUNDS = 6  # of fixing parameters and searching: two were enough


def estimated(
    starts: int = 6, seed: int = 1, *, progress: Progress | None = None, store: Path | None = None
) -> Estimate:
    """Return the free parameters that explain the statements best.

    From the end of the best start, the least determined parameter returns to Table 1. The search
    continues without it until the data determine all others. Then a search with all parameters
    free follows, and `settled`. Parameters that the statements do not determine stay at Table 1;
    the result lists them with the reason.

    Parameters
    ----------
    starts
        Number of starts: Table 1, then others around it.
    seed
        Seed of their random numbers.
    progress
        Called with a label and the finished share.
    store
        File that keeps every finished start.

    Returns
    -------
    Estimate
        Values [SI] with covariance; residuals in tolerances, in the order of `STATEMENTS`.

    Raises
    ------
    SolverError
        When no start reaches a minimum.
    """
    begin = scattered(unknowns(), starts, _SPREAD, seed)
    led = search(problem(), begin, LOSS, progress, store)
    first = estimate(problem(_sized(led.best.values)), LOSS, led.best.values)
    table1 = {u.name: u.start for u in unknowns()}
    values = table1 | dict(zip(first.names, first.values.tolist(), strict=True))
    best = settled(_searched(np.array([values[name] for name in table1]), ())).estimate
    return best.noted((f"{led.reached} of {starts} starts reached the lowest minimum",))


def settled(values: Array) -> Appraisal:
    """Return the nearby minimum whose undetermined parameters are at Table 1.

    Which parameters the statements determine depends on the brake. So the undetermined ones return
    to Table 1, and the search repeats for the others, until the undetermined parameters of the
    minimum are the fixed ones. If that never happens, the lowest minimum counts.

    Parameters
    ----------
    values
        All free parameters, in the order of `unknowns`, SI.

    Raises
    ------
    SolverError
        When a trajectory diverges.
    """
    appraisals: list[Appraisal] = []
    held_before: list[tuple[int, ...]] = []
    for _ in range(_ROUNDS):
        here = appraised(brake(_named(unknowns(), values)))
        appraisals.append(here)
        held = _undetermined(here)
        if held in held_before:
            break
        held_before.append(held)
        values = _searched(values, held)
    return min(appraisals[1:], key=lambda appraisal: appraisal.misfit)


def _searched(values: Array, held: tuple[int, ...]) -> Array:
    """Return the nearby minimum with the unknowns of some indices fixed at Table 1."""
    table1 = np.array([u.start for u in unknowns()])
    free = np.setdiff1d(np.arange(values.size), held)
    begin = np.where(np.isin(np.arange(values.size), held), table1, values)
    whole = problem(moved(_sized(values), begin))
    for index in sorted(held, reverse=True):
        whole = whole.held(index)
    end = begin.copy()
    end[free] = solve(whole, begin[free], LOSS).values
    return end


def _undetermined(here: Appraisal) -> tuple[int, ...]:
    """Return the indices of the parameters that the statements do not determine."""
    names = [u.name for u in unknowns()]
    return tuple(sorted(names.index(kept.unknown.name) for kept in here.estimate.kept))
