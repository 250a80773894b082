r"""Flux map of a saturated synchronous motor: tables of the flux linkages over both currents.

Both maps are the slopes of one potential, the coenergy W', which interpolates the tables:

.. math:: \psi_d = \frac{\partial W'}{\partial i_d}, \quad \psi_q = \frac{\partial W'}{\partial i_q}

The cross inductances of the interpolated maps are therefore equal everywhere, and the magnetic
energy does not depend on the path of the currents. The maps pass through all nodes of the tables.
Between nodes, the coenergy is a polynomial of fifth order in each current, whose second derivatives
continuous. Flux linkages and inductances therefore have no corners. Beyond the tables, inductances
are constant.

References
----------
P. Vas, Electrical Machines and Drives, Oxford University Press, 1992: cross saturation, and the
reciprocity of the cross inductances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Unit
from bywire.core.signals import Signal
from bywire.core.typing import Array
from bywire.core.validity import first, outside, within_limits

SignedNodes = tuple[Annotated[float, Field(allow_inf_nan=False)], ...]
Amperes = Annotated[float, Signal("A", "current", 5.0)]
Linkage = Annotated[float, Signal("V*s", "flux linkage", 6e-3)]
Coenergy = Annotated[float, Signal("V*s*A", "coenergy", 1e-2)]
SelfInductance = Annotated[float, Signal("H", "inductance", 1e-4), Gt(0)]

ALLOWED = 0.02
"""maximum difference of the cross inductances, as a fraction of the mean inductance (chosen)"""


class Parameters(ParameterSet):
    """Flux linkages that the currents cause, without those of the magnets.

    Each table contains one row for each d-axis current, one after the other. A row contains one
    value for each q-axis current.
    """

    i_d: Annotated[SignedNodes, Unit("A", 5.0)]
    """d-axis currents of the tables, increasing"""
    i_q: Annotated[SignedNodes, Unit("A", 5.0)]
    """q-axis currents of the tables, increasing"""
    psi_d: Annotated[SignedNodes, Unit("V*s", 1e-3)]
    """d-axis flux linkages, minus the magnets' flux linkage"""
    psi_q: Annotated[SignedNodes, Unit("V*s", 1e-3)]
    """q-axis flux linkages"""

    @model_validator(mode="after")
    def _is_a_map(self) -> Parameters:
        if not (self.i_d or self.i_q or self.psi_d or self.psi_q):
            return self  # of a motor without saturation
        for name, nodes in (("i_d", self.i_d), ("i_q", self.i_q)):
            if len(nodes) < 2 or not all(a < b for a, b in pairwise(nodes)):
                raise RuleError(name, _listed(nodes, "A"), "a table of 2 or more increasing nodes")
        size = len(self.i_d) * len(self.i_q)
        for name, table in (("psi_d", self.psi_d), ("psi_q", self.psi_q)):
            if len(table) != size:
                shape = f"{len(self.i_d)} rows (i_d) of {len(self.i_q)} nodes (i_q)"
                raise RuleError(name, f"{len(table)} nodes", f"of {size} nodes, {shape}")
        _require_equal_cross_slopes(self)
        return self

    @classmethod
    def fitting(cls, drawn: dict[str, object]) -> dict[str, object]:
        """Return a valid map with the scales of random numbers, for the contracts of elements."""
        spans: list[list[float]] = [list(drawn[name]) for name in ("i_d", "i_q")]  # type: ignore[call-overload]
        i_d, i_q = (
            [span[-1] * (2.0 * k / (len(span) - 1) - 1.0) for k in range(len(span))]
            for span in spans
        )
        last: float = list(drawn["psi_d"])[-1]  # type: ignore[call-overload]
        L = last / i_d[-1]
        bend, cross = 0.1 * L / i_d[-1] ** 2, 0.5 * L / i_q[-1]
        every = [(d, q) for d in i_d for q in i_q]
        psi_d = [L * d - bend * d**3 - 0.5 * cross * q * q for d, q in every]
        psi_q = [2.0 * L * q - cross * q * d for d, q in every]
        nodes = {"i_d": i_d, "i_q": i_q, "psi_d": psi_d, "psi_q": psi_q}
        return {name: tuple(each) for name, each in nodes.items()}


class Currents(NamedTuple):
    """Currents in rotor coordinates."""

    i_d: Amperes
    i_q: Amperes


class Flux(NamedTuple):
    """Flux linkages."""

    psi_d: Linkage
    psi_q: Linkage


class Inductances(NamedTuple):
    """Slopes of the maps."""

    L_dd: SelfInductance
    L_dq: Annotated[float, Signal("H", "cross inductance", 1e-5)]
    L_qq: SelfInductance


@dataclass(frozen=True)
class _Basis:
    """Polynomials in one cell for value, slope and curvature at each end, and their derivatives."""

    value: tuple[float, ...]
    slope: tuple[float, ...]
    curvature: tuple[float, ...]


_HERMITE = (
    (1.0, 0.0, 0.0, -10.0, 15.0, -6.0),
    (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
    (0.0, 1.0, 0.0, -6.0, 8.0, -3.0),
    (0.0, 0.0, 0.0, -4.0, 7.0, -3.0),
    (0.0, 0.0, 0.5, -1.5, 1.5, -0.5),
    (0.0, 0.0, 0.0, 0.5, -1.0, 0.5),
)
"""coefficients from 0 to 1: value at both ends, slope at both ends, curvature at both ends"""


def _listed(nodes: tuple[float, ...], unit: str) -> str:
    return f"({', '.join(f'{each:g}' for each in nodes)}) {unit}"


def _require_equal_cross_slopes(par: Parameters) -> None:
    """Reject maps whose magnetic energy would depend on the path of the currents."""
    psi_d, psi_q = _tables(par)
    h_d, h_q = ([b - a for a, b in pairwise(nodes)] for nodes in (par.i_d, par.i_q))
    own_d = [_secants(column, h_d) for column in _turned(psi_d)]
    own_q = [_secants(row, h_q) for row in psi_q]
    for name, own in (("psi_d", own_d), ("psi_q", own_q)):
        least = min(min(each) for each in own)
        if not least > 0.0:
            raise RuleError(
                name,
                f"a table whose slope is {1e3 * least:.3g} mH",
                f"a table that increases with i_{name[-1]}",
            )
    # Mean slopes of each cell. The tables have a potential if they are equal.
    over_d = [_rises(column, par.i_d) for column in _turned(psi_d)]
    over_q = [_rises(row, par.i_q) for row in psi_q]
    means = [sum(map(sum, own)) / (len(own) * len(own[0])) for own in (own_d, own_q)]
    allowed = ALLOWED * math.sqrt(means[0] * means[1])
    cells = [(k, n) for k in range(len(h_d)) for n in range(len(h_q))]
    of_d = {(k, n): (over_d[n + 1][k] - over_d[n][k]) / (h_d[k] * h_q[n]) for k, n in cells}
    of_q = {(k, n): (over_q[k + 1][n] - over_q[k][n]) / (h_d[k] * h_q[n]) for k, n in cells}
    k, n = worst = max(cells, key=lambda cell: abs(of_d[cell] - of_q[cell]))
    if abs(of_d[worst] - of_q[worst]) > allowed:
        raise RuleError(
            "psi_q",
            f"a table whose slope over i_d is {1e3 * of_q[worst]:.4g} mH (i_d = {par.i_d[k]:g} to "
            f"{par.i_d[k + 1]:g} A, i_q = {par.i_q[n]:g} to {par.i_q[n + 1]:g} A)",
            f"within {1e3 * allowed:.3g} mH of the slope of psi_d over i_q, "
            f"{1e3 * of_d[worst]:.4g} mH",
            "otherwise the magnetic energy depends on the path of the currents",
        )
    if any(
        of_d[k, n] ** 2 >= (own_d[n + 1][k] + own_d[n][k]) * (own_q[k + 1][n] + own_q[k][n]) / 4.0
        for k, n in cells
    ):
        raise RuleError(
            "psi_d",
            f"a table with a cross inductance of {1e3 * max(map(abs, of_d.values())):.3g} mH",
            "a table whose cross inductances are less than the mean of the self-inductances",
            "otherwise the magnetic energy is negative",
        )


def _cell(x: float, nodes: tuple[float, ...]) -> tuple[float, ...]:
    """Return 1 for the cell that contains the value, and 0 for the others; ends are open."""
    beyond = [ops.where(x < node, 0.0, 1.0) for node in nodes[1:-1]]
    return tuple(a - b for a, b in pairwise((1.0, *beyond, 0.0)))


def _basis(x: float, nodes: tuple[float, ...], cell: tuple[float, ...]) -> _Basis:
    """Return the polynomials in the cell, and their derivatives; beyond the nodes, parabolas."""
    start = _picked(cell, nodes[:-1])
    h = _picked(cell, tuple(b - a for a, b in pairwise(nodes)))
    inside = ops.clip(x, nodes[0], nodes[-1])
    s, beyond = (inside - start) / h, x - inside
    rows = []
    for k, coefficients in enumerate(_HERMITE):
        f: list[float] = list(coefficients)
        derivatives = []
        for _ in range(3):
            derivatives.append(_horner(f, s))
            f = [n * c for n, c in enumerate(f)][1:]
        scale = (1.0, h, h * h)[k // 2]
        v, dv, ddv = (d * scale / w for d, w in zip(derivatives, (1.0, h, h * h), strict=True))
        dv = dv + ddv * beyond
        rows.append((v + (dv - 0.5 * ddv * beyond) * beyond, dv, ddv))
    return _Basis(*zip(*rows, strict=True))


def _horner(coefficients: list[float], s: float) -> float:
    total = coefficients[-1] + 0.0 * s
    for each in reversed(coefficients[:-1]):
        total = total * s + each
    return total


def _picked(cell: tuple[float, ...], values: Sequence[float]) -> float:
    """Return the value of the cell that contains the current."""
    total = cell[0] * values[0]
    for share, value in zip(cell[1:], values[1:], strict=True):
        total = total + share * value
    return total


Rows = list[list[float]]


def _turned(rows: Rows) -> Rows:
    return [list(column) for column in zip(*rows, strict=True)]


def _secants(values: Sequence[float], widths: Sequence[float]) -> list[float]:
    return [(b - a) / width for (a, b), width in zip(pairwise(values), widths, strict=True)]


def _tables(par: Parameters) -> tuple[Rows, Rows]:
    """Return the tables of psi_d and psi_q, with a row for each i_d."""
    n = len(par.i_q)
    psi_d, psi_q = (
        [list(table[k : k + n]) for k in range(0, len(table), n)]
        for table in (par.psi_d, par.psi_q)
    )
    return psi_d, psi_q


def _slopes(values: Sequence[float], nodes: Sequence[float]) -> list[float]:
    """Return the slopes at the nodes, of a parabola through three nodes."""
    h = [b - a for a, b in pairwise(nodes)]
    secants = _secants(values, h)
    if len(h) == 1:
        return [secants[0], secants[0]]
    inner = [
        (h[k + 1] * secants[k] + h[k] * secants[k + 1]) / (h[k] + h[k + 1])
        for k in range(len(h) - 1)
    ]
    first_slope = secants[0] + (secants[0] - secants[1]) * h[0] / (h[0] + h[1])
    last = secants[-1] + (secants[-1] - secants[-2]) * h[-1] / (h[-1] + h[-2])
    return [first_slope, *inner, last]


def _rises(values: Sequence[float], nodes: Sequence[float]) -> list[float]:
    """Return the integral of a flux linkage between neighboring nodes."""
    L = _slopes(values, nodes)
    return [
        0.5 * h * (values[k] + values[k + 1]) + h * h / 12.0 * (L[k] - L[k + 1])
        for k, h in enumerate(b - a for a, b in pairwise(nodes))
    ]


def _sums(rises: list[float]) -> list[float]:
    total = [0.0 * rises[0]]
    for rise in rises:
        total.append(total[-1] + rise)
    return total


_Orders = tuple[tuple[Rows, Rows, Rows], ...]
_LATEST: list[tuple[Parameters, _Orders]] = []  # of the tables that were used last


def _derivatives(par: Parameters) -> _Orders:
    """Return the coenergy's derivatives at the nodes, which depend only on the tables.

    An assembly evaluates the map dozens of times with the same tables, as symbols.
    """
    for known, orders in tuple(_LATEST):
        if known is par:
            return orders
    orders = _computed(par)
    _LATEST[:] = [*_LATEST[-1:], (par, orders)]
    return orders


def _computed(par: Parameters) -> _Orders:
    """Return the coenergy's derivatives at the nodes, by their orders in i_d and i_q.

    The coenergy is the mean of the integrals along both edges of the tables.
    """
    d, q, n = par.i_d, par.i_q, len(par.i_q)
    psi_d, psi_q = _tables(par)
    over_q = [_sums(_rises(row, q)) for row in psi_q]
    over_d = [_sums(_rises(column, d)) for column in _turned(psi_d)]
    W = [
        [0.5 * (over_d[0][k] + over_q[k][m] + over_q[0][m] + over_d[m][k]) for m in range(n)]
        for k in range(len(d))
    ]

    def along_d(rows: Rows) -> Rows:
        return _turned([_slopes(column, d) for column in _turned(rows)])

    def along_q(rows: Rows) -> Rows:
        return [_slopes(row, q) for row in rows]

    pairs = zip(along_q(psi_d), along_d(psi_q), strict=True)
    cross = [[0.5 * (a + b) for a, b in zip(*rows, strict=True)] for rows in pairs]
    once = along_q(cross)
    return (
        (W, psi_q, along_q(psi_q)),
        (psi_d, cross, once),
        (along_d(psi_d), along_d(cross), along_d(once)),
    )


@dataclass(frozen=True)
class _Patch:
    """The cell that contains the currents: its 36 coefficients, and the polynomials in it."""

    coefficients: tuple[tuple[float, ...], ...]
    d: _Basis
    q: _Basis

    def sum(self, in_d: tuple[float, ...], in_q: tuple[float, ...]) -> float:
        """Return the sum over all products of the polynomials."""
        return _picked(in_d, [_picked(in_q, row) for row in self.coefficients])


def _patch(i: Currents, par: Parameters) -> _Patch:
    cell_d, cell_q = _cell(i.i_d, par.i_d), _cell(i.i_q, par.i_q)
    rows: list[tuple[float, ...]] = []
    for orders in _derivatives(par):
        ends: tuple[list[float], list[float]] = ([], [])
        for table in orders:
            for k in (0, 1):  # the lower and the upper end in i_q
                side = [_picked(cell_q, row[k : len(row) - 1 + k]) for row in table]
                for n in (0, 1):
                    ends[n].append(_picked(cell_d, side[n : len(side) - 1 + n]))
        rows += [tuple(end) for end in ends]
    return _Patch(tuple(rows), _basis(i.i_d, par.i_d, cell_d), _basis(i.i_q, par.i_q, cell_q))


def flux(i: Currents, par: Parameters) -> Flux:
    """Return the flux linkages that the currents cause."""
    at = _patch(i, par)
    return Flux(psi_d=at.sum(at.d.slope, at.q.value), psi_q=at.sum(at.d.value, at.q.slope))


def inductances(i: Currents, par: Parameters) -> Inductances:
    """Return the slopes of the flux linkages."""
    at = _patch(i, par)
    return Inductances(
        L_dd=at.sum(at.d.curvature, at.q.value),
        L_dq=at.sum(at.d.slope, at.q.slope),
        L_qq=at.sum(at.d.value, at.q.curvature),
    )


def coenergy(i: Currents, par: Parameters) -> Coenergy:
    """Return the coenergy from the currents, relative to that without current."""
    at, zero = _patch(i, par), _patch(Currents(0.0 * i.i_d, 0.0 * i.i_q), par)
    return at.sum(at.d.value, at.q.value) - zero.sum(zero.d.value, zero.q.value)


@within_limits
def watch(t: Array, i: Currents, par: Parameters) -> list[str]:
    """Warn if a current leaves the tables."""
    found: list[str] = []
    for name, values, nodes in (("i_d", i.i_d, par.i_d), ("i_q", i.i_q, par.i_q)):
        if nodes:
            text = f"{name} leaves the flux map, {nodes[0]:g} to {nodes[-1]:g} A,"
            found += first(t, outside(values, nodes[0], nodes[-1]), text)
    return found
