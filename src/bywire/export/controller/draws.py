"""Random inputs of an ECU: of their usual size, far beyond it, at limits, equal to each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, signals_of
from bywire.export.controller.program import Program

WILD, CALM, RELATED = tuple(range(10)), (9,) * 20 + tuple(range(10)), (9,) * 5 + (6, 6, 5)
"""kinds of draws: anything, hardly anything unusual, and much that is equal or at a limit"""
_DRIFTS = -5.0, -1.5
"""tenths of the usual size, as powers, by which signals drift in a tick"""
_LEVELS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, -1.0)


class Draw:
    """Draws signals: of their usual size, far beyond it, at limits, equal to each other."""

    def __init__(self, program: Program, rng: np.random.Generator, number: Callable[[float], Any]):
        self.rng, self.number = rng, number
        self.kinds = WILD
        leaves, units = program.par.leaves(), leaf_fields(type(program.par))
        self.limits: dict[str, list[float]] = {}
        read = {name for name, _ in program.parameters()}
        for name, value in leaves.items():
            group = name if name in units else name.rpartition(".")[0]
            if group in read:
                self.limits.setdefault(units[group].unit.symbol, []).append(value)

    def value(self, signal: Signal, others: list[float]) -> float:
        """Return a value of a signal; ``others``: those of its unit that are drawn already."""
        rng, nominal = self.rng, signal.nominal
        kind = int(rng.choice(self.kinds))
        if kind == 5 and signal.unit in self.limits:
            limits = self.limits[signal.unit]
            return float(rng.choice(limits) * rng.choice((1.0, 1.0, 1.0, -1.0, 0.5, 1.001, 0.999)))
        if kind == 6 and others:
            return float(rng.choice(others) * rng.choice((1.0, 1.0, 1.001, 0.999, 0.9)))
        if kind in (0, 3, 7) and signal.unit == "1":
            return float(rng.choice(_LEVELS))
        if kind < 3:
            return nominal * float(rng.uniform(-1.5, 3.0))
        if kind < 5:
            return nominal * float(10.0 ** rng.uniform(-3.0, 1.5) * rng.choice((-1.0, 1.0)))
        return 0.0 if kind == 8 else nominal * float(rng.uniform(0.0, 1.0))

    def tuple(self, cls: Any, used: set[str], pool: dict[str, list[float]]) -> Any:
        """Return signals of a NamedTuple; those that nobody reads have their usual size.

        ``pool``: values by unit that stand beside them, and to which these are added.
        """
        values: list[Any] = []
        for name, signal in signals_of(cls).items():
            drawn = signal.nominal
            if name in used:
                drawn = self.value(signal, pool.setdefault(signal.unit, []))
                pool[signal.unit].append(drawn)
            values.append(self.number(drawn))
        return cls(*values)

    def moved(self, values: Any, used: set[str]) -> Any:
        """Return signals with few of them changed."""
        cls: Any = type(values)
        signals = signals_of(cls)
        names = [n for n in sorted(used) if self.rng.random() < 2.0 / max(len(used), 1)]
        return values._replace(**{n: self.number(self.value(signals[n], [])) for n in names})

    def alike(self, values: Any, used: set[str]) -> Any:
        """Return signals of usual size, all of them smaller by about the same factor."""
        cls: Any = type(values)
        factor = float(10.0 ** self.rng.uniform(-2.0, 0.5))
        return values._replace(
            **{
                name: self.number(signal.nominal * factor * self.rng.uniform(0.6, 1.4))
                for name, signal in signals_of(cls).items()
                if name in used
            }
        )

    def drift(self, cls: Any, used: set[str]) -> dict[str, float]:
        """Return how far the signals of a NamedTuple move in a tick: some hardly, some at once."""
        return {
            name: signal.nominal * float(10.0 ** self.rng.uniform(*_DRIFTS) * self.rng.normal())
            for name, signal in signals_of(cls).items()
            if name in used
        }

    def drifted(self, values: Any, drift: Mapping[str, float]) -> Any:
        """Return signals a tick later."""
        return values._replace(
            **{name: self.number(getattr(values, name) + step) for name, step in drift.items()}
        )

    def parameters(self, par: ParameterSet) -> ParameterSet:
        """Return parameters with all numbers changed, tables by a factor, within their ranges."""
        leaves = leaf_fields(type(par))
        factors: dict[str, float] = {}
        values: dict[str, float] = {}
        for name, value in par.leaves().items():
            group = name if name in leaves else name.rpartition(".")[0]
            leaf = leaves[group]
            factor = factors.setdefault(group, float(self.rng.uniform(0.75, 1.25)))
            wanted = value * factor if value else 0.2 * factor * leaf.unit.nominal
            if not leaf.low <= wanted <= leaf.high:
                wanted = value / factor
            inside = min(max(wanted, leaf.low), leaf.high)
            is_open = (inside == leaf.low and leaf.low_open) or (
                inside == leaf.high and leaf.high_open
            )
            values[name] = value if is_open else inside
        return par.with_leaves(values)
