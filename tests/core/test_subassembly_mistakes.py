"""Assemblies in assemblies: every mistake has one error, with its place."""

from __future__ import annotations

from typing import Any

import pytest

from bywire.core import ops
from bywire.core.assembly import Assembly
from bywire.core.errors import ModelError
from bywire.core.parts import Sub, Wire
from bywire.core.signals import zeros
from bywire.core.wiring import check_wiring
from systems.ram_pair import BOTH, PAR, Held, Pair, PairParameters, Ram


class NoWire(Assembly[PairParameters, Any]):
    left = Sub(Ram, prefix="left_")
    more = Wire("A", "current")


class UnsetPort(Pair):
    def wire(self, w):
        w.left.load = 0.0


class EarlyRead(Pair):
    def wire(self, w):
        w.left.load, w.right.load = w.right.torque, 0.0


class WrongPort(Pair):
    def wire(self, w):
        w.left.load, w.right.load = w.left.motor.x.i, 0.0


class PortTwice(Pair):
    def wire(self, w):
        super().wire(w)
        w.left.load = 0.0


class NoSuchPort(Pair):
    def wire(self, w):
        w.left.laod = 0.0


class Assigned(Pair):
    def wire(self, w):
        w.left = 0.0


class NoTask(Pair):
    def tasks(self, par):
        return super().tasks(par)[:1]


class WrongFeed(Pair):
    left = Sub(Ram, prefix="left_", feeds={"v_set": "right_x_seen"})


class Nowhere(Pair):
    left = Sub(Ram, prefix="left_", par="lft")


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (NoWire, r"Ram.load is read before the holder sets it"),
        (UnsetPort, r"Ram.load is read before the holder sets it: assign w.NAME.load"),
        (EarlyRead, r"Ram.load is read before the holder sets it"),
        (WrongPort, r"a quantity in N and one in A cannot be added"),
        (PortTwice, r"Ram.load: .* sets it a second time"),
        (NoSuchPort, r"unknown part or wire 'laod': did you mean 'load'"),
        (Assigned, r"Pair.left is an assembly: set its ports"),
        (NoTask, r"the task right_source of right never runs: add \*super\(\).tasks\(par\)"),
        (WrongFeed, r"WrongFeed.left: its v_set is in V, but is fed by right_x_seen in m"),
        (Nowhere, r"Nowhere.left: the parameters have no 'lft'"),
    ],
)
def test_mistakes_are_said_with_their_place(model: type[Pair], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        check_wiring(model(), BOTH)


def test_a_class_without_wire_is_named_where_it_stands() -> None:
    class Alone(Assembly[PairParameters, Any]):
        Memory = Stimulus = Held
        more = Wire("A", "current")

    with pytest.raises(ModelError, match=r"Alone, .*_mistakes.py, line \d+: the wire"):
        check_wiring(Alone(), BOTH)


def declare(**body: Any) -> type[Any]:
    return type("Wrong", (Assembly,), {"name": "wrong", **body})


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (lambda: {"a": Sub(Ram, prefix="2_")}, r"Sub\(Ram\): the prefix '2_' is not valid"),
        (
            lambda: {"a": Sub(Ram, prefix="a_"), "b": Sub(Ram, prefix="a_")},
            r"Wrong.b: there is a signal 'a_i' already: give it another prefix",
        ),
        (
            lambda: {"a": Sub(Ram, prefix="a_", feeds={"v_st": "x"})},
            r"feeds names an unknown stimulus 'v_st': did you mean 'v_set'",
        ),
        (
            lambda: {"a": Sub(Ram, prefix="a_", feeds={"v_set": "a_vv"})},
            r"Wrong.a: v_set is fed by an unknown signal 'a_vv': did you mean 'a_v'",
        ),
        (lambda: {"a": Sub(Held, prefix="a_")}, r"Sub\(Held\): it is not an assembly"),
    ],
)
def test_mistakes_of_a_declaration_are_said(body: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        declare(**body())


def test_a_held_one_is_evaluated_at_the_instant_of_its_holder_alone() -> None:
    x, m = zeros(Pair.State), zeros(Pair.Memory)
    w = Pair().at(x, m, BOTH)
    with pytest.raises(ModelError, match="evaluated at a state other than its holder's"):
        w.left.at(zeros(Ram.State), zeros(Held), PAR)
    assert ops.fabs(w.left.torque) == 0.0
