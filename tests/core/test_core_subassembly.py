"""Subassemblies: with a prefix, an assembly gives the same numbers as alone."""

from __future__ import annotations

import pickle
from functools import partial
from typing import Any

import numpy as np
import pytest
import xarray as xr

from bywire.bench.energy_ledger import further_ledgers
from bywire.bench.recording import record
from bywire.contracts.model_contracts import closes_its_energy
from bywire.contracts.trial import Start, Trial
from bywire.core.assembly import Assembly
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Sub
from bywire.core.quantities import Stiffness
from bywire.core.signals import signals_of, zeros
from bywire.core.wiring import Node, network
from bywire.simulation.compiler import find_compiler
from bywire.simulation.program import check_model
from bywire.simulation.run import Run, simulate
from systems.ram_pair import BOTH, PAR, Coupled, Pair, PairParameters, Ram

needs_a_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def test_signals_get_prefix_label_and_book() -> None:
    assert Pair.State._fields == (
        "left_i",
        "left_theta",
        "left_omega",
        "right_i",
        "right_theta",
        "right_omega",
    )
    assert Pair.Memory._fields == ("left_v", "left_x_seen", "right_v", "right_x_seen")
    assert Pair.Stimulus._fields == ("left_v_set", "noise_left_v", "right_v_set", "noise_right_v")
    assert Pair.frictions == ("left_omega", "right_omega")
    assert set(Pair.right.records) <= set(Pair.Output._fields)
    shown = signals_of(Pair.Output)
    assert shown["left_torque"].label == "left: torque of the motor"
    assert shown["left_x_seen"].set_point_of == "left_theta"
    copper = shown["E_right_copper"].role
    assert copper is not None
    assert (copper.label, copper.book) == ("copper", "the other one")
    assert [task.name for task in Pair().tasks(BOTH)] == ["left_source", "right_source"]
    assert Pair().usually_open == (False,) * 4
    for kind in (Pair.State, Pair.Memory, Pair.Stimulus, Pair.Flow, Pair.Output):
        value = zeros(kind)
        assert pickle.loads(pickle.dumps(value)) == value


def test_equations_are_those_of_one_alone_number_by_number() -> None:
    """With stops pressed, friction at work, and the memory of a controller."""
    rng, model, alone = np.random.default_rng(5), Pair(), Ram()
    check_model(model, BOTH)
    x, xe, rate, m, flow = (
        kind._make(rng.standard_normal(len(kind._fields)).tolist())
        for kind in (Pair.State, Pair.State, Pair.State, Pair.Memory, Pair.Flow)
    )
    contact, reaction = (3.0, 0.0, 0.0, 7.0), (0.3, -0.1)
    rows = {
        "mass": (model.mass(xe, BOTH), "State"),
        "balance": (model.balance(x, xe, m, BOTH, contact), "State"),
        "powers": (model.powers(x, xe, rate, m, BOTH, contact, reaction), "Flow"),
        "output": (model.output(x, m, BOTH, contact, reaction, flow), "Output"),
    }
    bounds, gaps = model.bounds(x, xe, m, BOTH, contact), model.gap(x, xe, BOTH)
    for k, (sub, par) in enumerate(((Pair.left, BOTH.left), (Pair.right, BOTH.right))):
        own, own_e, own_rate, own_m, own_flow = (
            sub.inside(kind, values)
            for kind, values in (
                ("State", x),
                ("State", xe),
                ("State", rate),
                ("Memory", m),
                ("Flow", flow),
            )
        )
        pressed, rubbed = contact[2 * k : 2 * k + 2], reaction[k : k + 1]
        wanted = {
            "mass": alone.mass(own_e, par),
            "balance": alone.balance(own, own_e, own_m, par, pressed),
            "powers": alone.powers(own, own_e, own_rate, own_m, par, pressed, rubbed),
            "output": alone.output(own, own_m, par, pressed, rubbed, own_flow),
        }
        for name, (row, kind) in rows.items():
            assert sub.inside(kind, row) == wanted[name], name
        assert bounds[k : k + 1] == alone.bounds(own, own_e, own_m, par, pressed)
        assert gaps[2 * k : 2 * k + 2] == alone.gap(own, own_e, par)
        assert model.compliance(BOTH)[2 * k : 2 * k + 2] == alone.compliance(par)


def driven(model: Any, par: Any, amplitudes: list[float]) -> Any:
    """Return a run from rest with noise, sines of those amplitudes, against the stops and back."""
    state, memory = model.rest(par)

    def stimulus(t):
        waves = [a * np.sin(40.0 * t) for a in amplitudes]
        noise = np.random.default_rng(1).standard_normal(t.size)
        return np.stack([row for wave in waves for row in (wave, noise)], axis=-1)

    run = Run(model, par, state, memory, stimulus, 0.3, 20e-6, 1e-3)
    return run, simulate(run)


@needs_a_compiler
def test_two_in_one_run_as_two_alone() -> None:
    """Where both meet their stops and stand still at once: a substep is cut for all.

    What moves is the same bit by bit; frictions that let go are solved together, and rounded so.
    """
    same = PairParameters(left=PAR, right=PAR, k=2e3)
    _, both = driven(Pair(), same, [4.0, 4.0])
    _, one = driven(Ram(), PAR, [4.0])
    assert float(one["E_stop"][-1]) > 0.0
    assert (one["omega"][1:] == 0.0).any()
    for sub in (Pair.left, Pair.right):
        for name in Ram.Output._fields:
            got, wanted = both[sub.named(name)], one[name]
            assert np.abs(got - wanted).max() <= 1e-15 * np.abs(wanted).max(), name
        for name in ("i", "theta", "x", "torque", "v", "x_seen", "W_stop", "E_stop"):
            assert both[sub.named(name)].tobytes() == one[name].tobytes(), name


@needs_a_compiler
def test_two_that_differ_run_as_two_alone() -> None:
    """Each with events of its own, which cut substeps of the other one: to that error."""
    _, both = driven(Pair(), BOTH, [4.0, 5.0])
    for sub, par, size in ((Pair.left, BOTH.left, 4.0), (Pair.right, BOTH.right, 5.0)):
        _, one = driven(Ram(), par, [size])
        for name in ("theta", "E_copper", "E_dry"):
            scale = np.abs(one[name]).max()
            assert np.abs(both[sub.named(name)] - one[name]).max() < 1e-4 * scale, name


@needs_a_compiler
def test_what_is_coupled_by_ports_keeps_its_energy() -> None:
    check_model(Coupled(), BOTH)
    run, made = driven(Coupled(), BOTH, [4.0, 5.0])
    recording = record(run, made, 0.0, 0.0, {})
    books = further_ledgers(recording)
    assert set(books) == {"left", "the other one"}
    for book in books.values():
        assert abs(book.closing_error) < 1e-6 * book.turnover
        assert book.turnover > 0.1
    got = float(recording["E_spring"][-1])
    stretch = BOTH.left.gear.k_g * (made["left_theta"][-1] - made["right_theta"][-1])
    assert got == pytest.approx(0.5 * BOTH.k * stretch**2, rel=1e-3, abs=1e-6)
    given = float(recording["W_left_load"][-1] + recording["W_right_load"][-1])
    assert given == pytest.approx(got, rel=1e-9)


class Leaky(Ram):
    name = "leaky"

    def power(self, w):
        return super().power(w) | {"E_dry": 0.0}


class WithLeaky(Pair):
    right = Sub(Leaky, prefix="right_")


@needs_a_compiler
@pytest.mark.parametrize(("model", "broken"), [(Pair, set()), (WithLeaky, {"right"})])
def test_contracts_look_into_every_book(model: type[Pair], broken: set[str]) -> None:
    state, memory = model().rest(BOTH)
    start = Start(model(), BOTH, state, memory, zeros(model.Stimulus), "rest")
    evidence = list(closes_its_energy(Trial(model, lambda: start)))
    assert len(evidence) == 4  # a large and a small run, two books
    failed = [each.text for each in evidence if not each.holds]
    assert {name for name in broken if any(f"the balance {name!r}" in text for text in failed)} == (
        broken
    )
    assert bool(failed) == bool(broken)


def test_faults_of_a_recording_are_told_of_the_right_one() -> None:
    time = np.linspace(0.0, 0.1, 11)
    values = {"left_i": 1.0 + 0.0 * time, "right_i": 50.0 + 0.0 * time}
    recording = xr.Dataset({n: ("time", v) for n, v in values.items()}, {"time": time})
    said = Pair().watch(recording, BOTH)
    assert len(said) == 1
    assert said[0].startswith("the other one: the current leaves the sensor's")
    assert Pair().watched(BOTH) == ("left_i", "right_i")
    rows = {name: xr.DataArray(np.atleast_2d(v)) for name, v in values.items()}
    rows["time"] = xr.DataArray(time)
    silent = Pair().silent(rows, [BOTH])
    assert silent == {"left.sensor"}


def test_one_is_fed_by_the_memory_of_its_holder() -> None:
    class Fed(Pair):
        left = Sub(Ram, prefix="left_", feeds={"v_set": "right_v"})

    assert "left_v_set" not in Fed.Stimulus._fields
    task = Fed().tasks(BOTH)[0]
    x, m = zeros(Fed.State), zeros(Fed.Memory)._replace(right_v=5.0, left_v=1.0)
    after = task.tick(x, m, zeros(Fed.Stimulus), BOTH)
    assert after == m._replace(left_v=5.0 - 0.2, left_x_seen=0.0)


def test_one_with_options_of_its_own() -> None:
    class Geared(Ram):
        name = "geared"

        def __init__(self, share: float) -> None:
            self.share = share

        def friction(self, w):
            ((low, high),) = super().friction(w)
            return ((self.share * low, self.share * high),)

    class Other(Pair):
        right = Sub(partial(Geared, 3.0), prefix="right_")

    x, m = zeros(Other.State), zeros(Other.Memory)
    left, right = Other().bounds(x, x, m, BOTH, (0.0,) * 4)
    assert left == (-0.02, 0.01)
    assert right == (3.0 * -0.03, 3.0 * 0.5 * 0.03)


def test_one_within_one_within_one() -> None:
    class OuterParameters(ParameterSet):
        pair: PairParameters
        k: Stiffness

    class Outer(Assembly[OuterParameters, Any]):
        name = "outer"
        inner = Sub(Coupled, prefix="a_", par="pair")

    par = OuterParameters(pair=BOTH, k=1.0)
    check_model(Outer(), par)
    assert Outer.frictions == ("a_left_omega", "a_right_omega")
    assert "E_a_left_copper" in Outer.Output._fields
    assert [task.name for task in Outer().tasks(par)] == ["a_left_source", "a_right_source"]
    state, memory = Outer().rest(par)
    assert state.a_left_theta == state.a_right_theta == 1.0
    x = state._replace(a_left_theta=2.0)
    inner = Coupled.State._make(x)
    m = zeros(Coupled.Memory)
    alone = Coupled().balance(inner, inner, m, BOTH, (0.0,) * 4)
    assert Outer().balance(x, x, memory, par, (0.0,) * 4) == tuple(alone)
    role = signals_of(Outer.Output)["E_a_left_copper"].role
    assert role is not None
    assert role.book == "a: left"


def test_its_network_shows_it_as_one_box() -> None:
    found = network(Coupled(), BOTH)
    left = Node("part", "left")
    assert found.ports[left] == ("load", "v")
    assert {each.name for each in found.sources(left, "load")} == {"force"}
    assert found.sources(left, "v") == [Node("task", "left_source")]
    assert {n.name for n in found.sources(Node("wire", "force"))} == {"left", "right"}
