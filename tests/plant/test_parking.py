"""Pawl, parking cable and park-brake law against their rules and closed forms."""

import math

import numpy as np
import pytest

from bywire.control import parking
from bywire.core.errors import ParameterError
from bywire.plant import drum, parking_cable, pawl_lock, thermal_growth
from raising import raises

PAWL = {
    "law": "mono-stable",
    "delta": 0.25,
    "r": 0.01,
    "k": 200.0,
    "tau": 1e-3,
    "mu": 0.15,
    "F_spring": 3.0,
    "F_sol": 5.0,
}


def pawl(**changes):
    return pawl_lock.Parameters.create(PAWL | changes)


def after(par, *commands, engaged=1.0, tooth=10.0):
    """Return the memory of a pawl after some commands: angle, torque, current, and speed 0."""
    x = pawl_lock.Latch(engaged, tooth, 0.0)
    for theta, torque, powered in commands:
        x = pawl_lock.latch(x, pawl_lock.Command(theta, 0.0, torque, powered), par)
    return x


def test_a_solenoid_releases_only_against_spring_and_friction():
    par = pawl()
    # F_sol = 5 N > 3 N + 0.15 T / 10 mm up to T = 0.1333 N m
    assert pawl_lock.release_force(0.2 / 1.5, par) == pytest.approx(5.0)
    assert after(par, (2.5, 0.134, 1.0)).engaged == 1.0
    assert after(par, (2.5, 0.133, 1.0)).engaged == 0.0
    assert after(par, (2.5, 0.3, 1.0), (2.6, 0.0, 1.0)).engaged == 0.0  # overtravel unloads it
    assert after(pawl(F_sol=2.9), (2.5, 0.0, 1.0)).engaged == 1.0


def test_a_mono_stable_pawl_engages_without_power_and_a_bi_stable_pawl_stays():
    assert after(pawl(), (2.5, 0.0, 1.0), (2.5, 0.0, 0.0)).engaged == 1.0
    assert after(pawl(), (2.5, 0.0, 0.0), engaged=0.0).engaged == 1.0
    par = pawl(law="bi-stable")
    pulse, rest = (2.5, 0.0, 1.0), (2.5, 0.0, 0.0)
    engaged = [after(par, *commands).engaged for commands in ((rest,), (pulse,), (pulse, rest))]
    assert engaged == [1.0, 0.0, 0.0]
    assert after(par, pulse, pulse).engaged == 0.0  # one pulse toggles once
    assert after(par, pulse, rest, pulse).engaged == 1.0


def test_teeth_slide_below_an_engaged_pawl_toward_clamping():
    par = pawl()
    x = after(par, (2.6, 0.0, 0.0), (3.1, 0.0, 0.0), (3.3, 0.0, 0.0), (2.9, 0.0, 0.0))
    assert x.tooth == 13.0  # of 3.25 rad, which the shaft passed; it does not turn back
    assert pawl_lock.target(x, par) == 3.25


@pytest.mark.parametrize("omega", [-600.0, -50.0, 0.0, 300.0])
def test_a_pawl_moves_in_behind_a_turning_shaft(omega):
    """It does not meet a tooth that the shaft has passed on its way back."""
    par, T = pawl(), 1e-5
    theta, stop = 100.0, pawl_lock.State(pawl_lock.target(pawl_lock.Latch(0.0, 400.0, 0.0), pawl()))
    x = pawl_lock.latch(
        pawl_lock.Latch(0.0, 400.0, 0.0), pawl_lock.Command(theta, omega, 0.0, 0.0), par
    )
    for _ in range(500):
        u = pawl_lock.Input(theta, omega, pawl_lock.target(x, par))
        assert pawl_lock.forces(stop, u, par).T_pawl == 0.0
        rate = pawl_lock.balance(stop, u).theta_stop / par.tau
        stop, theta = pawl_lock.State(stop.theta_stop + T * rate), theta + T * omega


CABLE = {"mu": 0.1, "phi": 3.0, "i": 5.0}
DRUM = {
    "law": "simplex",
    "r": 0.150,
    "b": 0.032,
    "a": 0.12265,
    "c": 0.212,
    "theta_1": 0.0,
    "theta_2": math.radians(126),
    "mu": 0.32,
}


def test_a_cable_loses_and_holds_force():
    par = parking_cable.Parameters.create(CABLE)
    u = parking_cable.Input(300.0, 0.0)
    F = parking_cable.output(u, par)
    assert 300.0 + F.F_p == pytest.approx(300.0 * math.exp(0.3))  # to pull
    assert 300.0 - F.F_n == pytest.approx(300.0 * math.exp(-0.3))  # below which it slips back
    shoes = parking_cable.shoes(u, par)
    assert shoes.primary - shoes.secondary == 300.0  # forces on the lever


def test_a_parked_drum_holds_with_both_shoes():
    par, shoes = parking_cable.Parameters.create(CABLE), drum.Parameters.create(DRUM)
    u = parking_cable.Input(500.0, 0.0)
    holding = parking_cable.holding_torque(parking_cable.shoes(u, par), shoes)
    leading, trailing = drum.shoe_factors(shoes)
    assert holding.T_p == pytest.approx(0.15 * (2500.0 * leading + 2000.0 * trailing))
    assert holding.T_n == pytest.approx(0.15 * (2000.0 * leading + 2500.0 * trailing))
    assert holding.T_p > holding.T_n
    equal = parking_cable.holding_torque(parking_cable.Shoes(2279.0, 2279.0), shoes)
    assert equal.T_p == equal.T_n == pytest.approx(527.8, rel=1e-3)


LAW = {
    "law": "force",
    "lock": "screw",
    "F_park": 20e3,
    "F_again": 19e3,
    "i_park": 15.0,
    "t_inrush": 0.1,
    "t_again": 1.0,
    "again": 2.0,
    "t_unlock": 0.5,
    "t_rest": 0.05,
    "theta_open": 0.0,
}
T = 0.01


class Law:
    """The law with inputs that a test changes."""

    def __init__(self, **changes):
        self.par = parking.Parameters.create(LAW | changes)
        self.x = parking.State(parking.RELEASED, 0.0, 0.0, 0.0)
        self.u = parking.Input(0.0, 0.0, 0.0, 0.0, 0.0)

    def runs(self, samples, **inputs):
        """Run some samples with changed inputs, and return mode and drive."""
        self.u = self.u._replace(**inputs)
        for _ in range(samples):
            self.x, out = parking.output(self.x, self.u, T, self.par)
        return self.x.mode, out.drive


def test_the_law_clamps_to_a_force_and_again_after_the_disc_has_cooled():
    law = Law()
    assert law.runs(1) == (parking.RELEASED, 0.0)
    assert law.runs(5, park=1.0, F=5e3) == (parking.CLAMPS, 1.0)
    assert law.runs(1, F=20.1e3) == (parking.HOLDS, 0.0)
    assert law.runs(150, F=19.5e3) == (parking.HOLDS, 0.0)  # enough force after t_again
    assert law.runs(40, F=18e3) == (parking.HOLDS, 0.0)  # not yet due
    assert law.runs(20) == (parking.CLAMPS, 1.0)
    assert law.x.clamped == 1.0
    assert law.runs(1, F=20e3) == (parking.HOLDS, 0.0)
    law.runs(110, F=18e3)
    law.runs(1, F=20e3)
    assert law.x.clamped == 2.0
    assert law.runs(500, F=18e3) == (parking.HOLDS, 0.0)  # at most twice
    assert law.runs(1, park=0.0, theta=50.0) == (parking.RELEASES, -1.0)
    assert law.runs(1, theta=-0.1) == (parking.RELEASED, 0.0)
    assert law.runs(2) == (parking.RELEASED, 0.0)
    assert law.x.clamped == 0.0


def test_the_law_clamps_to_a_current_after_the_inrush():
    law = Law(law="current", again=1.0)
    assert law.runs(5, park=1.0, i=30.0) == (parking.CLAMPS, 1.0)
    law.runs(10, i=2.0)
    assert law.runs(1, i=15.0) == (parking.HOLDS, 0.0)
    assert law.runs(102, i=0.0) == (parking.CLAMPS, 1.0)


@pytest.mark.parametrize("lock", ["mono-stable", "bi-stable"])
def test_the_law_unloads_a_pawl_before_it_releases(lock):
    law, par = Law(lock=lock), pawl(law=lock)
    x = pawl_lock.Latch(1.0 if lock == "mono-stable" else 0.0, 10.0, 0.0)

    def runs(samples, torque, **inputs):
        nonlocal x
        for _ in range(samples):
            mode, drive = law.runs(1, engaged=x.engaged, theta=2.5, **inputs)
            command = pawl_lock.Command(2.5, 0.0, torque, law.x.powered)
            x = pawl_lock.latch(x, command, par)
        return mode, drive

    runs(5, 0.0, park=1.0, F=5e3)
    assert x.engaged == 1.0  # a bi-stable pawl got its pulse
    assert runs(3, 0.5, F=20e3) == (parking.HOLDS, 0.0)
    assert runs(4, 0.5, park=0.0) == (parking.UNLOCKS, 1.0)  # a loaded tooth holds the pawl
    assert x.engaged == 1.0
    runs(4, 0.0)
    assert x.engaged == 0.0
    assert (law.x.mode, law.runs(1, engaged=0.0)) == (parking.RELEASES, (parking.RELEASES, -1.0))


def test_a_brake_that_does_not_unlock_stops_its_motor():
    law = Law(lock="mono-stable")
    law.runs(5, park=1.0, F=5e3, engaged=1.0)
    law.runs(2, F=20e3)
    assert law.runs(40, park=0.0) == (parking.UNLOCKS, 1.0)
    assert law.x.powered == 1.0
    assert law.runs(20) == (parking.UNLOCKS, 0.0)
    assert law.x.powered == 0.0


def test_clamping_again_must_be_below_the_clamping_force():
    with raises(ParameterError, name="F_again", valid="< F_park"):
        Law(F_again=21e3)


def test_a_disc_shrinks_by_its_coefficient():
    par = thermal_growth.Parameters.create(
        {"alpha": 1.2e-5, "length": 24e-3, "tau": 600.0, "T_a": 293.15}
    )
    out = thermal_growth.output(thermal_growth.State(573.15), par)
    assert out.growth == pytest.approx(1.2e-5 * 24e-3 * 280.0)
    assert out.rate == pytest.approx(-out.growth / 600.0)
    assert np.isclose(thermal_growth.balance(thermal_growth.State(573.15), par).T, -280.0)
