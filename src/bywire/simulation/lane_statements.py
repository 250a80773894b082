"""Statements of a model's stages in vectors of cases."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bywire.simulation.emission import (
    branching_statements,
    layout_of,
    leaf_namer,
    midpoints,
    statements,
    unread,
)
from bywire.simulation.expressions import VECTOR_C, as_number, condition, needed
from bywire.simulation.layout import Layout
from bywire.simulation.modes import modes
from bywire.simulation.operation import Node
from bywire.simulation.stages import Stages


class Lanes:
    """Statements of every stage, in vectors: of one of some that take turns.

    ``at``: which one of ``turns``.
    """

    def __init__(self, stages: Stages, at: int = 0, turns: int = 1) -> None:
        self.at, self.turns, self.mark = at, turns, "ab"[at] if turns > 1 else ""
        self.stages, self.graph, self.level = stages, stages.graph, stages.level()
        self.layout: Layout = layout_of(stages)
        skipped = unread(stages)
        self.results = {
            f"{kind}{k}": node
            for kind in ("x", "d", "r")
            for k, node in enumerate(stages.fast[kind])
            if f"{kind}{k}" not in skipped
        }
        self.products = stages.quadrature.products
        self.flag = stages.fast["flag"][0]
        self.pass_roots = [*self.results.values(), *self.products, self.flag]
        self.coefficients = [c for pairs in stages.quadrature.combinations for c, _ in pairs]
        self.carried = midpoints(
            self.graph, needed(self.graph, self.pass_roots, lambda n: self.level[n] < 2)
        )
        self.name = leaf_namer(self.graph, self._leaf, self._value, "SET({})")
        self.mode = modes(self.graph, self.pass_roots, self.level).without(self.carried)
        judged = self._read_by([self.flag, stages.fast["doubtful"][0]])
        self._judged = [n for n in self.mode.rest if n in judged]
        self._later = [n for n in self.mode.rest if n not in judged]

    def _read_by(self, roots: Iterable[Node]) -> frozenset[Node]:
        """Return the operations that roots need, however often they are computed."""
        return frozenset(needed(self.graph, roots, lambda _: False))

    def _leaf(self, kind: str, index: int) -> str:
        if kind == "p":
            return f"P[{self.row(index)}]"
        if kind == "u":
            return f"U{self.mark}[{index}]"
        return "h" if kind == "h" else f"{kind}{index}{self.mark}"

    def row(self, index: int) -> int:
        """Return which vector in memory is the one of an entry."""
        return index * self.turns + self.at

    def marked(self, *names: str) -> list[str]:
        """Return the names of variables that every vector has for itself."""
        return [f"{name}{self.mark}" for name in names]

    def _value(self, node: Node) -> str:
        name = f"y{self.carried[node]}" if node in self.carried else f"v{node}"
        return f"{name}{self.mark}"

    def block(self, roots: Sequence[Node], below: int) -> list[str]:
        """Return the statements that results need, apart from what is computed less often."""
        order = needed(self.graph, roots, lambda n: self.level[n] < below)
        return self.lines(order)

    def lines(self, order: Sequence[Node], later: Sequence[Node] = ()) -> list[str]:
        """Return the statements of nodes; ``later``: those that read them, too."""
        return branching_statements(self.graph, order, self.name, "const V ", VECTOR_C, later)

    def number(self, node: Node) -> str:
        """Return the text of a result."""
        return as_number(self.graph, node, self.name, VECTOR_C)

    def once(self) -> list[str]:
        """Return the statements of what depends on parameters alone."""
        ticks = [n for task in self.stages.ticks for n in task]
        roots = [*self.pass_roots, *self.coefficients, *ticks, *self.stages.output]
        order = needed(self.graph, roots, lambda _: False)
        return self.lines([n for n in order if self.level[n] == 0])

    def framed(self) -> list[str]:
        """Return the statements of what changes with the ticks."""
        roots = [*self.pass_roots, *self.coefficients]
        order = needed(self.graph, roots, lambda n: self.level[n] == 0)
        own = frozenset(self.mode.values)
        return self.lines([n for n in order if self.level[n] == 1 and n not in own])

    def mode_state(self) -> list[str]:
        """Return the declarations of what changes with the mode alone, and of the mode."""
        if not self.mode.atoms:
            return []
        values = [f"V {self.name(n)} = SET(0.0);" for n in self.mode.values]
        return [*values, *(f"B b{n} = (B){{0}};" for n in self.mode.atoms), "int fresh = 1;"]

    def judged(self) -> list[str]:
        """Return the statements of what tells whether one pass serves a substep.

        What hangs on the mode is renewed with it.
        """
        mode = self.mode
        rest = self.lines(self._judged, self._later)
        if not mode.atoms:
            return rest
        changed = " | ".join(f"(n{n} ^ b{n})" for n in mode.atoms)
        truth = [condition(self.graph, n, self.name, VECTOR_C) for n in mode.atoms]
        renewed = statements(self.graph, mode.values, self.name, "", VECTOR_C)
        return [
            *self.lines(mode.first),
            *(f"const B n{n} = {text};" for n, text in zip(mode.atoms, truth, strict=True)),
            f"if (__builtin_expect(fresh | ANY({changed}), 0)) {{",
            "  fresh = 0;",
            *(f"  b{n} = n{n};" for n in mode.atoms),
            *(f"  {line}" for line in renewed),
            "}",
            *rest,
        ]

    def sums(self) -> list[str]:
        """Return the statements of the integrands, each added to its sum as soon as it is there."""
        lines, rest = [], self._later
        for k, product in enumerate(self.products):
            read = self._read_by([product])
            order, rest = [n for n in rest if n in read], [n for n in rest if n not in read]
            lines += [*self.lines(order, rest), f"s{k}{self.mark} += {self.number(product)};"]
        return lines

    def finished(self, is_summed: bool = True) -> list[str]:
        """Return the statements of the results that the flag does not need.

        ``is_summed``: whether those of `sums` are there.
        """
        there = self._read_by(self.products if is_summed else ())
        wanted = self._read_by(self.results.values()) - there
        return self.lines([n for n in self._later if n in wanted])
