"""Contract in README.txt: exported steps with inputs, memory and parameters of arbitrary bits."""

from __future__ import annotations

import ctypes
import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported_ecu import STRUCTURES, bench_of, needs_compiler

import bywire
from bywire.core.errors import ParameterError
from bywire.core.signals import limits_of, ranges_of
from bywire.export.controller.contract import INPUT, LARGEST, RESULT
from bywire.export.controller.in_the_loop import _leaves_read, compiled
from bywire.export.controller.program import Program, Step, program
from bywire.simulation.compiler import find_compiler
from systems.loading import loaded

pytestmark = needs_compiler
CALIPER = Path(__file__).parents[3] / "examples" / "emb_caliper"


class Ecu:
    """An exported ECU in this process, driven by names."""

    def __init__(self, case: Any, precision: str = "double") -> None:
        self.made: Program = program(case.model, case.par, precision)
        compiler = find_compiler()
        assert compiler is not None
        self.library = compiled(self.made, compiler)
        self.real: Any = np.float32 if precision == "single" else np.float64
        model = self.made.model
        self.names = {
            kind: [each.name for each in self.made.members(cls)]
            for kind, cls in (("memory", model.Memory), ("x", model.State), ("u", model.Stimulus))
        }
        room = len(self.made.steps) + 1
        self.values = {k: np.zeros(len(n) + room, self.real) for k, n in self.names.items()}
        for name in self.names["memory"]:
            self["memory", name] = getattr(case.memory, name)
        state = case.state
        for name in self.names["x"]:
            self["x", name] = getattr(state, name)
        given = case.stimulus(np.zeros(1))
        for name in self.names["u"]:
            self["u", name] = float(given[name][0]) if name in given else 0.0
        leaves = _leaves_read(self.made, list(case.par.leaves()))
        numbers = np.array(list(case.par.leaves().values()))
        self.par = np.zeros(len(leaves), self.real)
        self.par[leaves >= 0] = numbers[leaves[leaves >= 0]]
        if self.made.derived:
            getattr(self.library, f"{self.made.name}_ecu_derive")(self._pointer(self.par))

    @staticmethod
    def _pointer(values: Any) -> Any:
        return values.ctypes.data_as(ctypes.c_void_p)

    def __getitem__(self, at: tuple[str, str]) -> float:
        return float(self.values[at[0]][self.names[at[0]].index(at[1])])

    def __setitem__(self, at: tuple[str, str], value: float) -> None:
        self.values[at[0]][self.names[at[0]].index(at[1])] = value

    def step(self, step: Step) -> int:
        """Call a step, and return its status."""
        function = getattr(self.library, step.name)
        function.restype = None
        kinds = {**self.values, "par": self.par}
        function(*(self._pointer(kinds[short]) for _, short in step.arguments))
        at = len(self.names["memory"])
        statuses = self.values["memory"][at:].view(np.uint32)
        return int(statuses[[each.name for each in self.made.steps].index(step.name)])

    def memory(self) -> bytes:
        """Return the bits of the memory without the statuses."""
        return self.values["memory"][: len(self.names["memory"])].tobytes()

    def limit(self, by: str) -> float:
        """Return the limit of a command as it is now."""
        if by in self.names["u"]:
            return self["u", by]
        names = [dotted for dotted, _ in self.made.held()]
        return float(self.par[names.index(by)])


def cases() -> Iterator[tuple[str, Any]]:
    """Yield the case of each structure."""
    for structure in STRUCTURES:
        yield structure, bench_of(structure).cases()[0]
    with loaded(CALIPER):
        yield "caliper", bywire.Bench("clamp-step", "emb42v").cases()[0]


PRECISIONS = ["double", pytest.param("single", marks=pytest.mark.trust)]
"""single daily by every export's own harness"""
BAD = (math.nan, math.inf, -math.inf, LARGEST, -LARGEST, 1e308, -1e308)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_refused_inputs_leave_the_memory_and_calm_ticks_follow(precision: str) -> None:
    for structure, case in cases():
        ecu, calm = Ecu(case, precision), Ecu(case, precision)
        refused = 0
        for step in ecu.made.steps:
            assert ecu.step(step) == calm.step(step) == 0
            for each in step.inputs:
                at, before = (each.kind, each.field), ecu.memory()
                accepted = ecu[at]
                ends = [each.low - 0.5] * math.isfinite(each.low)
                ends += [each.high + 0.5] * math.isfinite(each.high)
                with np.errstate(over="ignore"):
                    for value in (*BAD, *ends):
                        ecu[at] = value
                        assert ecu.step(step) == INPUT, (structure, each, value)
                        assert ecu.memory() == before, (structure, each, value)
                        refused += 1
                ecu[at] = accepted
        for _ in range(50):
            for step in ecu.made.steps:
                assert ecu.step(step) == calm.step(step) == 0
        assert ecu.memory() == calm.memory(), structure
        assert refused >= 14, structure


def test_a_second_without_a_number_is_forgotten() -> None:
    """A brake whose demand was NaN for a while then continues as before."""
    case = bench_of("pressure, sine dither").cases()[0]
    ecu, calm = Ecu(case), Ecu(case)
    (step,) = ecu.made.steps
    for k in range(5000):
        ecu["u", "p_set"] = math.nan if 100 <= k < 1100 else calm["u", "p_set"]
        assert ecu.step(step) == (INPUT if 100 <= k < 1100 else 0)
        if not 100 <= k < 1100:
            calm.step(step)
    assert ecu.memory() == calm.memory()
    assert math.isfinite(ecu["memory", "duty"])


def any_number(rng: np.random.Generator, real: Any) -> float:
    """Return a number with arbitrary bits, often a special number."""
    if rng.random() < 0.3:
        return float(rng.choice([*BAD, 5e-324, -5e-324, 0.0, -0.0, 1.0, -1.0, 1e30, 2.0, 1e14]))
    if real is np.float32:
        return float(np.frombuffer(rng.bytes(4), np.float32)[0])
    return float(struct.unpack("<d", rng.bytes(8))[0])


@pytest.mark.parametrize("precision", PRECISIONS)
def test_no_numbers_at_all_drive_a_command_beyond_its_limit(precision: str) -> None:
    rng, limited = np.random.default_rng(5), set()
    for structure, case in cases():
        ecu = Ecu(case, precision)
        start, usual = {k: v.copy() for k, v in ecu.values.items()}, ecu.par.copy()
        with np.errstate(all="ignore"):
            for _ in range(300):
                for kind, names in ecu.names.items():
                    ecu.values[kind][:] = start[kind]
                    for name in names:
                        if rng.random() < (0.5 if kind == "memory" else 0.15):
                            ecu[kind, name] = any_number(rng, ecu.real)
                ecu.par[:] = usual
                for k in np.flatnonzero(rng.random(len(ecu.par)) < 0.05):
                    ecu.par[k] = any_number(rng, ecu.real)
                for step in ecu.made.steps:
                    status = ecu.step(step)
                    for each in step.commands:
                        value, limit = ecu["memory", each.field], ecu.limit(each.by)
                        limited.add(each.field)
                        if each.is_input:
                            assert status != 0 or value <= limit, (structure, each)
                        else:
                            most = limit if limit >= 0.0 else 0.0
                            assert abs(value) <= most, (structure, each, value, limit)
                    for name in step.kept:
                        assert status == INPUT or abs(ecu["memory", name]) <= LARGEST
    assert limited == {"duty", "i_1_ref", "i_2_ref", "p_f_ref", "p_r_ref"}


def test_a_memory_without_numbers_begins_anew() -> None:
    case = bench_of("moment and position").cases()[0]
    ecu = Ecu(case)
    for name in ecu.names["memory"]:
        ecu["memory", name] = math.nan
    assert [ecu.step(step) for step in ecu.made.steps] == [RESULT, 0]
    assert ecu.memory() == bytes(len(ecu.memory())) or math.isfinite(ecu["memory", "i_1_ref"])
    for _ in range(20):
        assert [ecu.step(step) for step in ecu.made.steps] == [0, 0]


@pytest.mark.parametrize("value", [2.0, -1.0])
def test_a_bench_refuses_a_stimulus_that_its_ecu_would_refuse(value: float) -> None:
    run = next(iter(bench_of("moment and position").runs().values()))
    at = run.model.Stimulus._fields.index("power_off")

    def stimulus(t: Any) -> Any:
        rows = np.array(run.stimulus(t))
        rows[:, at] = np.where(t > 0.01, value, rows[:, at])
        return rows

    from dataclasses import replace

    wrong = replace(run, stimulus=stimulus, duration=0.02)
    with pytest.raises(ParameterError, match=rf"power_off is {value:g} at t = .* must be >= 0"):
        bywire.simulate(wrong)


def test_ranges_and_limits_are_read_beside_signals() -> None:
    from bywire.brakes.wedge.control import Memory, Stimulus

    assert ranges_of(Stimulus) == {"power_off": (0.0, 1.0)}
    assert {n: each.by for n, each in limits_of(Memory).items()} == {
        "i_1_ref": "control.position.i_max",
        "i_2_ref": "control.position.i_max",
    }
