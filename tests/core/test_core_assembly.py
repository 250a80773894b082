"""Assemblies: derived equations, and errors of wiring with place and next step."""

from __future__ import annotations

import pickle
from typing import Annotated, Any, ClassVar, NamedTuple

import pytest

from bywire.core.assembly import Assembly
from bywire.core.errors import ModelError
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.quantities import Length
from bywire.core.signals import Role, Signal, signals_of
from bywire.core.wiring import check_wiring
from bywire.plant import ball_screw_gear, dc_motor, end_stop
from bywire.simulation.program import check_model
from raising import raises


class Parameters(ParameterSet):
    """A motor on a screw between two stops."""

    motor: dc_motor.Parameters
    gear: ball_screw_gear.Parameters
    stop: end_stop.Parameters
    stroke: Length


class Held(NamedTuple):
    """Voltage."""

    v: Annotated[float, Signal("V", "voltage", 6.0)]


class Screw(Assembly[Parameters, Held]):
    """The correct version of the faulty assemblies in this file."""

    name = "screw"
    Memory = Stimulus = Held
    motor = Part(dc_motor, loss="E_copper")
    gear = Part(ball_screw_gear, output={"x": "x"})
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    W_in = Integral("J", "work of the source", role=Role("source", "source"))
    torque = Wire("N*m", "torque of the motor", 0.1)
    P_in = Shown("W", "power of the source")

    def wire(self, w):
        w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
        piston = ball_screw_gear.output(w.gear.x, w.gear.par)
        w.stop.u = end_stop.Input(piston.x, piston.v, 0.0, w.par.stroke)
        w.motor.u = dc_motor.Input(w.m.v, w.gear.x.omega)
        w.gear.u = ball_screw_gear.Input(w.torque, end_stop.load(w.stop.f), 0.0)

    def power(self, w):
        return {"W_in": w.m.v * w.motor.x.i}

    def record(self, w):
        return {"P_in": w.m.v * w.motor.x.i}

    def tasks(self, par):
        return (Task("source", 1e-3, lambda x, m, u, par: u),)


PAR = Parameters(
    motor=dc_motor.Parameters(R_m=0.35, L_m=1e-4, K_e=0.03),
    gear=ball_screw_gear.Parameters(k_g=3e-4, eta_g=0.9, law="directional", J_mot=3e-5, M_mc=0.1),
    stop=end_stop.Parameters(k_stop=1e7, tau_stop=1e-4),
    stroke=0.01,
)


def test_all_follows_from_the_parts() -> None:
    model = Screw()
    check_model(model, PAR)
    assert Screw.State._fields == ("i", "theta", "omega")
    assert Screw.Flow._fields == ("E_copper", "W_stop", "W_in")
    assert Screw.Output._fields == (
        "i",
        "theta",
        "omega",
        "v",
        "E_copper",
        "W_stop",
        "W_in",
        "E_stored",
        "x",
        "E_stop",
        "torque",
        "P_in",
    )
    shown = signals_of(Screw.Output)
    assert shown["x"] == signals_of(ball_screw_gear.Output)["x"]
    assert shown["E_copper"].label == "copper loss"
    assert shown["E_copper"].role == Role("sink", "copper", split=True)
    assert model.usually_open == (True, True)
    x, m = Screw.State(i=2.0, theta=-1.0, omega=5.0), Held(6.0)
    rows = model.balance(x, x, m, PAR, (10.0, 0.0))
    assert rows == (6.0 - 0.35 * 2.0 - 0.03 * 5.0, 5.0, 0.03 * 2.0 + 3e-4 * 10.0)
    assert model.mass(x, PAR) == (1e-4, 1.0, ball_screw_gear.inertia(PAR.gear))
    row = model.output(x, m, PAR, (10.0, 0.0), (), Screw.Flow(0.0, 5.0, 0.0))
    elastic = 0.5 * 1e7 * (3e-4) ** 2
    assert row.E_stop == pytest.approx(5.0 - elastic)
    kinetic = ball_screw_gear.energy(ball_screw_gear.State(-1.0, 5.0), PAR.gear)
    assert row.E_stored == pytest.approx(0.5 * 1e-4 * 4.0 + kinetic + elastic)
    assert pickle.loads(pickle.dumps(x)) == x


def test_states_are_made_from_those_of_the_parts() -> None:
    x = Screw.state(gear=ball_screw_gear.State(theta=1.0, omega=0.0))
    assert x == Screw.State(0.0, 1.0, 0.0)
    assert Screw().at(x, Held(0.0), PAR).gear.x.theta == 1.0
    with pytest.raises(ModelError, match=r"unknown part 'gaer': did you mean 'gear'"):
        Screw.state(gaer=ball_screw_gear.State(1.0, 0.0))
    with pytest.raises(ModelError, match=r"Screw.gear: State is not a state of ball_screw_gear"):
        Screw.state(gear=dc_motor.State(1.0))


class Forgotten(Screw):
    def wire(self, w):
        w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
        piston = ball_screw_gear.output(w.gear.x, w.gear.par)
        w.stop.u = end_stop.Input(piston.x, piston.v, 0.0, w.par.stroke)
        w.motor.u = dc_motor.Input(w.m.v, w.gear.x.omega)


class Unset(Screw):
    more = Wire("A", "current")


class Twice(Screw):
    def wire(self, w):
        super().wire(w)
        w.torque = 0.0


class InputTwice(Screw):
    def wire(self, w):
        super().wire(w)
        w.motor.u = dc_motor.Input(0.0, 0.0)


class Early(Screw):
    def wire(self, w):
        w.gear.u = ball_screw_gear.Input(w.torque, 0.0, 0.0)


class WrongUnit(Screw):
    def wire(self, w):
        w.torque = w.motor.x.i
        w.gear.u = ball_screw_gear.Input(w.torque, 0.0, 0.0)
        w.stop.u = end_stop.Input(0.0, 0.0, 0.0, w.par.stroke)
        w.motor.u = dc_motor.Input(w.m.v, 0.0)


class WrongInput(Screw):
    def wire(self, w):
        w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
        w.gear.u = ball_screw_gear.Input(w.m.v, 0.0, 0.0)
        w.stop.u = end_stop.Input(0.0, 0.0, 0.0, w.par.stroke)
        w.motor.u = dc_motor.Input(w.m.v, 0.0)


class UnlikeSum(Screw):
    def wire(self, w):
        w.torque = w.motor.x.i + w.m.v


class OtherElement(Screw):
    def wire(self, w):
        w.motor.u = ball_screw_gear.Input(0.0, 0.0, 0.0)


class UnknownPart(Screw):
    def wire(self, w):
        w.moter.u = dc_motor.Input(0.0, 0.0)


class UnknownWire(Screw):
    def wire(self, w):
        w.torqe = 0.0


class OnItself(Screw):
    def wire(self, w):
        w.torque = self.motor.x.i


class Unitless(Screw):
    more = Wire("", "something")

    def wire(self, w):
        super().wire(w)
        w.more = 0.0 * w.m.v + w.m.v


class OddUnit(Screw):
    more = Wire("flurb", "something")

    def wire(self, w):
        super().wire(w)
        w.more = w.m.v


class NoPower(Screw):
    def power(self, w):
        return {}


class OddPower(Screw):
    def power(self, w):
        return {"W_out": 0.0, **super().power(w)}


class PowerOfAnotherUnit(Screw):
    def power(self, w):
        return {"W_in": w.m.v}


class NoParameters(Screw):
    gear = Part(ball_screw_gear, par="gaer", output={"x": "x"})


MISTAKES: list[tuple[type[Screw], str, dict[str, str]]] = [
    (Forgotten, "Forgotten", {"name": "gear", "valid": "ball_screw_gear.Input(torque"}),
    (Unset, "Unset", {"name": "more", "valid": "A"}),
    (Twice, "a second time", {"name": "Screw.torque"}),
    (InputTwice, "a second time", {"name": "Screw.motor"}),
    (Early, "read before it is set", {"name": "Screw.torque", "valid": "w.torque = ..."}),
    (WrongUnit, "WrongUnit.wire", {"name": "torque", "value": "A", "valid": "N*m"}),
    (WrongInput, "WrongInput.wire", {"name": "gear.u.torque", "value": "V", "valid": "N*m"}),
    (UnlikeSum, "cannot be added", {"name": "UnlikeSum.wire", "value": "A", "valid": "V"}),
    (
        OtherElement,
        "assigns a",
        {
            "name": "Screw.motor",
            "value": "bywire.plant.ball_screw_gear.Input",
            "valid": "a dc_motor.Input",
        },
    ),
    (UnknownPart, "UnknownPart", {"name": "part or wire", "value": "moter", "valid": "motor"}),
    (UnknownWire, "UnknownWire", {"name": "part or wire", "value": "torqe", "valid": "torque"}),
    (OnItself, "has no value here", {"name": "Screw.motor", "valid": "model.at("}),
    (Unitless, "Unitless", {"name": "more"}),
    (OddUnit, "is not known", {"name": "more", "value": "flurb"}),
    (NoPower, "does not return", {"name": "NoPower.power", "value": "W_in"}),
    (OddPower, "OddPower.power", {"name": "signal", "value": "W_out"}),
    (PowerOfAnotherUnit, "PowerOfAnotherUnit.power", {"name": "W_in", "valid": "J"}),
    (NoParameters, "the parameters have no", {"name": "NoParameters.gear", "value": "gaer"}),
]


@pytest.mark.parametrize(
    ("model", "words", "fields"), MISTAKES, ids=lambda value: getattr(value, "__name__", "-")
)
def test_mistakes_of_wiring_are_named(
    model: type[Screw], words: str, fields: dict[str, str]
) -> None:
    with raises(ModelError, **fields) as caught:
        check_wiring(model(), PAR)
    assert words in str(caught.value)


@pytest.mark.parametrize("model", [Forgotten, Twice, WrongUnit, WrongInput, UnlikeSum])
def test_mistakes_of_wiring_have_a_line(model: type[Screw]) -> None:
    with pytest.raises(ModelError, match=r"\.py, line \d+"):
        check_wiring(model(), PAR)


class Sampled(NamedTuple):
    """A memory with the name of a state."""

    i: Annotated[float, Signal("A", "sampled current")]


def declared(**body: Any) -> None:
    type("Wrong", (Screw,), body)


def test_mistakes_of_declaration_are_named() -> None:
    with raises(ModelError, name="Wrong.second", value="i", valid="Part(..., suffix='_2')"):
        declared(second=Part(dc_motor, par="motor"))
    with raises(ModelError, name="state", value="thta", valid="theta"):
        declared(second=Part(ball_screw_gear, par="gear", state={"thta": "angle"}))
    with raises(ModelError, name="signal", value="thteta", valid="theta"):
        declared(records=("thteta",))
    with raises(ModelError, name="output", value="y", valid="v, x"):
        declared(second=Part(ball_screw_gear, suffix="_2", output=("y",)))
    with raises(ModelError, name="Wrong.Memory", value="i"):
        declared(Memory=Sampled)
    with raises(ModelError, name="heat"):
        declared(second=Part(dc_motor, suffix="_2", loss={"E_heat": "heat"}))
    with raises(ModelError, name="option", value="sufix", valid="suffix"):
        Part(dc_motor, sufix="_2")  # type: ignore[call-overload]


class Massless:
    """An element with a state and a balance, but no mass."""

    __name__ = "massless"
    Parameters = dc_motor.Parameters
    State = dc_motor.State
    Input = dc_motor.Input
    balance = staticmethod(dc_motor.balance)


def test_a_state_needs_a_mass() -> None:
    element: Any = Massless()
    with raises(ModelError, name="Wrong.second", valid="mass"):
        declared(second=Part(element, suffix="_2"))


class VariedOnce(Screw):
    def wire(self, w):
        w.motor.vary(R_m=2.0 * w.motor.par.R_m, K_e=0.5 * w.motor.par.K_e)
        super().wire(w)


class VariedNothing(Screw):
    def wire(self, w):
        w.motor.vary(R=1.0)


def test_parameters_that_follow_the_state_are_the_elements_everywhere() -> None:
    plain, varied = (
        each().at(Screw.state(motor=dc_motor.State(3.0)), Held(1.0), PAR)
        for each in (Screw, VariedOnce)
    )
    assert varied.motor.par.R_m == 2.0 * plain.motor.par.R_m
    assert varied.torque == 0.5 * plain.torque
    rows = varied.balance(varied.x, varied.x, Held(1.0), PAR, (0.0, 0.0))
    assert rows.i == pytest.approx(1.0 - 2.0 * PAR.motor.R_m * 3.0)
    assert PAR.motor.R_m == plain.motor.par.R_m
    with raises(ModelError, name="parameter", value="R"):
        VariedNothing().at(Screw.state(), Held(0.0), PAR)


def test_labels_name_outputs_too() -> None:
    part = Part(ball_screw_gear, output={"x": "x_mc"}, labels={"x": "plunger travel"})
    assert part.outputs()["x_mc"].label == "plunger travel"
    assert "x" not in {signal.label for signal in part.states().values()}


class TwoMotors(Assembly[Any, Held]):
    """Two motors with a loss each, and two stops that share theirs."""

    name: ClassVar[str] = "two-motors"
    Memory: ClassVar[Any] = Held
    Stimulus: ClassVar[Any] = Held
    first = Part(dc_motor, suffix="_1", which="drive", loss="E_1")
    second = Part(dc_motor, suffix="_2", which="pump", loss="E_2")
    low = Part(end_stop, work="W_low", loss="E_stops", which="low")
    high = Part(end_stop, work="W_high", loss="E_stops", which="high")

    def wire(self, w: Any) -> None:
        """Connect nothing, because only the labels matter."""


def test_an_energy_of_one_part_names_it_in_the_balance() -> None:
    energies = signals_of(TwoMotors.Flow)
    assert energies["E_2"].label == "copper loss, pump"
    assert energies["E_2"].role == Role("sink", "copper, pump", split=True)
    assert energies["W_high"].label.endswith(", high")
    shared = signals_of(TwoMotors.Output)["E_stops"]
    assert ", low" not in shared.label
    assert ", high" not in shared.label
