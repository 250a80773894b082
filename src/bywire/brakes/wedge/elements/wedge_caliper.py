"""Floating caliper over the wedge: clearance, disc runout, stiffness or force table."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Length, Nodes, Stiffness, TimeConstant, Unit
from bywire.core.signals import ContactCompliance, Energy, Overlap, Role, Signal
from bywire.core.units import shown

Clearance = Annotated[float, Unit("m", 2e-4), Field(ge=0, allow_inf_nan=False)]
Work = Annotated[float, Signal("W", "work on the caliper")]
Loss = Annotated[
    float,
    Signal(
        "W", "loss in the caliper, minus its initial energy", role=Role("sink", "caliper damping")
    ),
]
NormalForce = Annotated[float, Signal("N", "normal force", 3e3)]


class Parameters(ParameterSet):
    """Pads, disc and caliper as one spring that pushes but never pulls.

    ``law``: ``"linear"`` uses a constant stiffness. ``"table"`` interpolates a measured curve of
    force versus travel and continues beyond its end with its last slope.
    """

    law: Literal["linear", "table"]
    """relation between travel and force"""
    K_cal: Stiffness
    """stiffness of caliper and pads (law "linear")"""
    n_table: Annotated[Nodes, Unit("m", 1e-4)]
    """pad travels after contact, increasing from 0 (law "table")"""
    F_table: Annotated[Nodes, Unit("N", 3e3)]
    """normal forces of the table, increasing from 0 (law "table")"""
    tau_cal: TimeConstant
    """ratio of damping to stiffness"""
    clearance: Clearance
    """running clearance, sum over both sides of the disc"""
    r_B: Length
    """effective radius of the pads"""

    @model_validator(mode="after")
    def _table_is_a_curve(self) -> Parameters:
        n, F = self.n_table, self.F_table
        for name, unit, nodes in (("n_table", "m", n), ("F_table", "N", F)):
            _require_rising(name, unit, nodes)
        if len(n) != len(F):
            valid = f"of the same length as F_table, {len(F)} nodes"
            raise RuleError("n_table", f"{len(n)} nodes", valid, "set one force for each travel")
        if self.law == "table" and not n:
            reason = "law = 'table' needs n_table and F_table. Set both, or set law = 'linear'"
            raise RuleError("n_table", "0 nodes", "of 2 nodes or more", reason)
        return self


FAULTS = (
    ParameterFault(
        "gap-grown", "increased clearance: worn pads, failed adjuster", ("clearance",), 2.0
    ),
    ParameterFault(
        "pad-lost", "a pad is lost (value: clearance)", replaced="clearance", value=10e-3
    ),
    ParameterFault("soft", "softer caliper or pads", ("K_cal",), 0.5),
)


def _require_rising(name: str, unit: str, nodes: Nodes) -> None:
    if not nodes:
        return
    if len(nodes) < 2:
        raise RuleError(name, f"{len(nodes)} nodes", "of 2 nodes or more")
    if nodes[0] != 0.0:
        raise RuleError(
            f"{name}.0", shown(nodes[0], unit), f"{shown(0.0, unit)}, the start of the curve"
        )
    for k, (a, b) in enumerate(pairwise(nodes), 1):
        if b <= a:
            reason = "sort the nodes, and omit nodes where the curve does not rise"
            raise RuleError(
                f"{name}.{k}", shown(b, unit), f"> {shown(a, unit)}, the previous node", reason
            )


class Input(NamedTuple):
    """Wedge travel, slope and side, disc runout, and adjuster travel."""

    x: Annotated[float, Signal("m", "wedge travel", 5e-3)]
    v: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    side: Annotated[float, Signal("1", "side of the wedge, +1 or -1")]
    tan_alpha: Annotated[float, Signal("1", "slope of the wedge", 0.4)]
    runout: Annotated[float, Signal("m", "runout", 4e-6)]
    runout_rate: Annotated[float, Signal("m/s", "rate of the runout", 2e-4)]
    taken: Annotated[float, Signal("m", "clearance removed by an adjuster", 1e-4)]
    taking: Annotated[float, Signal("m/s", "speed of the adjuster", 2e-4)]


class InputRate(NamedTuple):
    """Derivatives of the arguments of the stored energy. Slope and side are constant."""

    x: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    side: Annotated[float, Signal("1/s", "rate of the side")]
    tan_alpha: Annotated[float, Signal("1/s", "rate of the slope")]
    runout: Annotated[float, Signal("m/s", "rate of the runout", 2e-4)]
    taken: Annotated[float, Signal("m/s", "speed of the adjuster", 2e-4)]


class Forces(NamedTuple):
    """Normal force, >= 0."""

    F_N: NormalForce


def depth(u: Input, par: Parameters) -> Overlap:
    r"""Return the overlap, negative in the gap.

    .. math:: n = |x| \tan\alpha - (c - c_{taken}) + \text{runout}
    """
    return u.side * u.x * u.tan_alpha - par.clearance + u.runout + u.taken


def closing(u: Input) -> Annotated[float, Signal("m/s", "rate of the overlap", 5e-3)]:
    """Return the rate of the overlap."""
    return u.side * u.v * u.tan_alpha + u.runout_rate + u.taking


def overlaps(u: Input, par: Parameters) -> Overlap:
    """Return the damped overlap, n + tau dn/dt."""
    return depth(u, par) + par.tau_cal * closing(u)


def compliance(par: Parameters) -> ContactCompliance:
    """Return the compliance of caliper and pads. For a table, its first piece counts."""
    if par.law == "table":
        return par.n_table[1] / par.F_table[1]
    return 1.0 / par.K_cal


def normal_force(
    f: Annotated[float, Signal("N", "contact force", 3e3)], par: Parameters
) -> NormalForce:
    r"""Return the normal force for a contact force with constant compliance.

    .. math:: F_N = f + \sum_k (K_k - K_{k-1}) \max(0, C f - n_k)

    with the stiffness K_k from node n_k on and the compliance C = 1/K_0 of :func:`compliance`.

    Notes
    -----
    Contacts have constant compliances, which determine whether they are closed. The table maps
    their forces, with the damped overlap C f. At low rates, the damping is therefore tau times the
    slope of the curve. The contact never pulls and never adds energy, because the curve rises.
    """
    if par.law == "linear":
        return f
    return f + _bent(f * compliance(par), par)


def bent(f: Forces, par: Parameters) -> Forces:
    """Return the contact forces from those with constant compliance (see `normal_force`)."""
    return Forces(F_N=normal_force(f.F_N, par))


def forces(u: Input, par: Parameters) -> Forces:
    r"""Return the normal force, :math:`F_N = K_{CAL} \max(0, n + \tau \dot n)`, or from the table.

    References
    ----------
    Roberts et al. (2003), section "Wedge and calliper", with clearance, runout and damping.
    """
    return Forces(F_N=_elastic_force(ops.fmax(overlaps(u, par), 0.0), par))


def travel(F_N: NormalForce, par: Parameters) -> Overlap:
    """Return the overlap at rest for a normal force >= 0."""
    if par.law == "linear":
        return F_N / par.K_cal
    n = F_N * compliance(par)
    for (_, F), before, after in _bends(par):
        n = n + (1.0 / after - 1.0 / before) * ops.fmax(F_N - F, 0.0)
    return n


def moment(
    F_N: NormalForce,
    mu_B: Annotated[float, Signal("1", "friction of the pads", 0.35)],
    turning: Annotated[float, Signal("1", "disc direction, 0 when stopped")],
    par: Parameters,
) -> Annotated[float, Signal("N*m", "braking moment", 300.0)]:
    r"""Return the braking moment of both pads, :math:`M_B = 2 \mu_B s(\Omega) F_N r_B`."""
    return 2.0 * mu_B * turning * F_N * par.r_B


def input_rate(u: Input) -> InputRate:
    """Return the rates of wedge, disc and adjuster."""
    return InputRate(x=u.v, side=0.0, tan_alpha=0.0, runout=u.runout_rate, taken=u.taking)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy."""
    n = ops.fmax(depth(u, par), 0.0)
    if par.law == "linear":
        return 0.5 * par.K_cal * n * n
    stored = 0.5 * n * n / compliance(par)
    for (n_k, _), before, after in _bends(par):
        more = ops.fmax(n - n_k, 0.0)
        stored = stored + 0.5 * (after - before) * more * more
    return stored


def power_in(u: Input, f: Forces) -> Work:
    """Return the work of wedge, runout and adjuster on the caliper."""
    return f.F_N * closing(u)


def power_loss(u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the power that the damping dissipates, >= 0."""
    return (f.F_N - _elastic_force(ops.fmax(depth(u, par), 0.0), par)) * closing(u)


def _elastic_force(n: float, par: Parameters) -> float:
    """Return the normal force [N] of an overlap >= 0 [m]."""
    if par.law == "linear":
        return par.K_cal * n
    return n / compliance(par) + _bent(n, par)


def _bent(n: float, par: Parameters) -> float:
    """Return the table's force minus the force at its first slope [N]."""
    force = 0.0 * n / compliance(par)
    for (n_k, _), before, after in _bends(par):
        force = force + (after - before) * ops.fmax(n - n_k, 0.0)
    return force


def _bends(par: Parameters) -> Iterator[tuple[tuple[float, float], float, float]]:
    """Yield each inner node (travel, force) with the stiffnesses [N/m] before and after it."""
    nodes = list(zip(par.n_table, par.F_table, strict=True))
    slopes = [(F1 - F0) / (n1 - n0) for (n0, F0), (n1, F1) in pairwise(nodes)]
    yield from zip(nodes[1:-1], slopes[:-1], slopes[1:], strict=True)
