"""Subassemblies: each mistake gives one error with its place."""

from __future__ import annotations

from typing import Any

import pytest

from bywire.core import ops
from bywire.core.assembly import Assembly
from bywire.core.errors import ModelError
from bywire.core.parts import Sub, Wire
from bywire.core.signals import zeros
from bywire.core.wiring import check_wiring
from raising import raises
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
    ("model", "fields"),
    [
        (NoWire, {"name": "Ram.load"}),
        (UnsetPort, {"name": "Ram.load", "valid": "w.NAME.load"}),
        (EarlyRead, {"name": "Ram.load", "valid": "w.NAME.load"}),
        (WrongPort, {"name": "WrongPort.wire", "value": "N", "valid": "A"}),
        (PortTwice, {"name": "Ram.load"}),
        (NoSuchPort, {"name": "part or wire", "value": "laod", "valid": "load"}),
        (Assigned, {"name": "Pair.left", "valid": "w.left.PORT"}),
        (NoTask, {"name": "right_source"}),
        (WrongFeed, {"name": "v_set", "value": "m", "valid": "V"}),
        (Nowhere, {"name": "Nowhere.left", "value": "lft"}),
    ],
)
def test_mistakes_are_said_with_their_place(model: type[Pair], fields: dict[str, str]) -> None:
    with raises(ModelError, **fields):
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
    ("body", "fields"),
    [
        (
            lambda: {"a": Sub(Ram, prefix="2_")},
            {"name": "prefix", "value": "2_", "valid": "such as 'rear_'"},
        ),
        (
            lambda: {"a": Sub(Ram, prefix="a_"), "b": Sub(Ram, prefix="a_")},
            {"name": "Wrong.b", "value": "a_i"},
        ),
        (
            lambda: {"a": Sub(Ram, prefix="a_", feeds={"v_st": "x"})},
            {"name": "stimulus", "value": "v_st", "valid": "v_set"},
        ),
        (
            lambda: {"a": Sub(Ram, prefix="a_", feeds={"v_set": "a_vv"})},
            {"name": "signal", "value": "a_vv", "valid": "a_v"},
        ),
        (
            lambda: {"a": Sub(Held, prefix="a_")},
            {"name": "Sub(Held)", "valid": "a class that inherits from Assembly"},
        ),
    ],
)
def test_mistakes_of_a_declaration_are_said(body: Any, fields: dict[str, str]) -> None:
    with raises(ModelError, **fields):
        declare(**body())


def test_a_held_one_is_evaluated_at_the_instant_of_its_holder_alone() -> None:
    x, m = zeros(Pair.State), zeros(Pair.Memory)
    w = Pair().at(x, m, BOTH)
    with raises(ModelError, name="Ram"):
        w.left.at(zeros(Ram.State), zeros(Held), PAR)
    assert ops.fabs(w.left.torque) == 0.0
