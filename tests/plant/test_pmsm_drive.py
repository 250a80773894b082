"""The synchronous motor's drive in the engine: independent reference, energy, saturation, heat."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bywire.core.errors import ParameterError
from bywire.plant import dc_link, flux_map, pmsm
from bywire.simulation.advance import Change
from bywire.simulation.run import simulate
from raising import raises
from systems.pmsm_drive import SERVO, T_S, parameters, run

L = 0.2e-3
GRID = np.linspace(-20.0, 20.0, 7)


def currents_of(psi_d, psi_q):
    """Return the currents of flux linkages, without magnets: the inverse of `map_of`, by Newton."""
    d, q = psi_d / L, psi_q / (1.5 * L)
    for _ in range(20):
        own = map_of(d, q)
        off_d, off_q = psi_d - own[0], psi_q - own[1]
        dd, dq = L - 0.3 * L / 400 * d * d, -0.1 * L / 20 * q
        qq = 1.5 * L - 0.1 * L / 20 * d - 0.6 * L / 400 * q * q
        det = dd * qq - dq * dq
        step_d, step_q = (qq * off_d - dq * off_q) / det, (dd * off_q - dq * off_d) / det
        d, q = d + step_d, q + step_q
        if abs(step_d) + abs(step_q) < 1e-12:
            return d, q
    raise ArithmeticError("no inverse of the map")


def map_of(i_d, i_q):
    """Return the flux linkages of a motor that saturates in both axes, from one potential."""
    return (
        L * i_d - 0.1 * L / 400 * i_d**3 - 0.05 * L / 20 * i_q**2,
        1.5 * L * i_q - 0.1 * L / 20 * i_q * i_d - 0.2 * L / 400 * i_q**3,
    )


def tables(f=map_of, grid=GRID):
    """Return the flux map of a function."""
    psi_d, psi_q = f(*np.meshgrid(grid, grid, indexing="ij"))
    nodes = {"i_d": grid, "i_q": grid, "psi_d": psi_d, "psi_q": psi_q}
    return {name: tuple(np.ravel(each).tolist()) for name, each in nodes.items()}


def saturated(**changes):
    maps = {f"motor__map.{name}": nodes for name, nodes in tables().items()}
    return parameters(motor__law="saturated", **maps, **changes)


class Reference:
    """Motor, shaft and control, written from the equations in flux linkages and phase currents."""

    def __init__(self, currents, J, load, i_set, omega):
        self.p, self.R, self.psi = 4.0, SERVO["R"], SERVO["psi"]
        self.currents, self.J, self.load = currents, J, load
        k_p, k_i = L / (3 * T_S), SERVO["R"] / (3 * T_S)
        y = np.array([0.0, 0.0, omega, 0.0])  # flux of the currents, speed, angle
        emf = self.p * omega * self.psi
        waiting = emf * np.exp(1j * (np.pi / 2 + self.p * omega * T_S * 0.5))
        acting = emf * np.exp(1j * (np.pi / 2 - self.p * omega * T_S * 0.5))
        z = 0j
        self.rows = []
        for _ in range(100):
            i = complex(*self.currents(y[0], y[1]))
            self.rows.append((i.real, i.imag, y[2]))
            acting = waiting
            omega_e, error = self.p * y[2], complex(0.0, i_set) - i
            v = k_p * error + z + 1j * omega_e * (L * i + self.psi)
            z += T_S * k_i * error
            waiting = v * np.exp(1j * self.p * (y[3] + 1.5 * T_S * y[2]))
            y = solve_ivp(
                self.rate, (0.0, T_S), y, "DOP853", args=(acting,), rtol=1e-10, atol=1e-12
            ).y[:, -1]

    def rate(self, t, y, held):
        i = complex(*self.currents(y[0], y[1]))
        v, omega_e = held * np.exp(-1j * self.p * y[3]), self.p * y[2]
        flux = complex(y[0] + self.psi, y[1])
        change = v - self.R * i - 1j * omega_e * flux
        torque = 1.5 * self.p * (np.conj(flux) * i).imag
        return change.real, change.imag, (torque - self.load) / self.J, y[2]


@pytest.mark.parametrize("law", ["linear", "saturated"])
def test_a_transient_agrees_with_an_independent_integration(law):
    """A current step while the shaft accelerates from 150 rad/s; the map has a cubic potential."""
    exact = Reference(
        currents_of if law == "saturated" else lambda d, q: (d / L, q / L), 2e-5, 0.05, 7.0, 150.0
    )
    drive = saturated if law == "saturated" else parameters
    found = simulate(
        run(drive(shaft__J=2e-5, link__C=1e3), 7.0, 0.05, 150.0, duration=99 * T_S, step=5e-6)
    )
    i_d, i_q, omega = np.array(exact.rows).T
    # The step's numerical error, and with a map the interpolation error of its coarse tables.
    within = 1.5e-2 if law == "saturated" else 2e-3
    assert found["i_d"] == pytest.approx(i_d, abs=within)
    assert found["i_q"] == pytest.approx(i_q, abs=within)
    assert found["omega"] == pytest.approx(omega, rel=1e-4)


CASES = {
    "linear": (parameters, {}, 1e-11),
    "dead time": (parameters, {"inverter__law": "dead time", "inverter__V_f": 0.4}, 1e-6),
    "iron": (parameters, {"motor__iron": "drag", "motor__c_h": 2.0, "motor__c_e": 1e-2}, 1e-8),
    "diode": (parameters, {"link__law": "diode", "link__chopper": "resistor"}, 1e-6),
    "saturated": (saturated, {}, 1e-6),
}


def residual(recording):
    """Return the largest residual of the energy balance, relative to the energy transferred."""
    sinks = [n for n in recording.names if n.startswith("E_") and n != "E_source"]
    off = recording["E_source"] - sum(recording[name] for name in sinks)
    return np.ptp(off) / np.abs(np.diff(recording["E_source"])).sum()


@pytest.mark.parametrize("name", CASES)
def test_energy_is_balanced(name):
    drive, changes, most = CASES[name]

    def swinging(t):
        return 5 + 9 * np.sin(1257 * t)

    found = simulate(run(drive(**changes), swinging, 0.05, 200.0, step=5e-6))
    assert residual(found) < most


def test_iron_takes_torque():
    """P = c_h w_e psi^2 + c_e w_e^2 psi^2 at a known flux, as a torque on the shaft."""
    par = parameters(motor__iron="drag", motor__c_h=2.0, motor__c_e=1e-2, shaft__J=1.0)
    found = simulate(run(par, 0.0, 0.0, 200.0, 0.02, record=1e-5))
    i_d, i_q, omega = (found[name][-11:].mean() for name in ("i_d", "i_q", "omega"))
    square = (SERVO["psi"] + L * i_d) ** 2 + (L * i_q) ** 2
    hysteresis, eddy = 2.0 * 4 * omega * square, 1e-2 * (4 * omega) ** 2 * square
    rates = [np.diff(found[name][-11::10])[-1] / 1e-4 for name in ("E_hysteresis", "E_iron")]
    assert rates == pytest.approx([hysteresis, eddy], rel=1e-4)
    torque = 1.5 * 4 * SERVO["psi"] * i_q - (hysteresis + eddy) / omega
    assert np.diff(found["omega"][-11::10])[-1] / 1e-4 == pytest.approx(torque, rel=2e-4)


def test_heat_weakens_magnets_and_raises_the_resistance():
    warm = {"heat__law": "lumped", "heat__T_a": 393.15, "heat__T_most": 450.0}
    hot, cold = (simulate(run(p, 5.0, 0.0, 0.0, 5e-3)) for p in (parameters(**warm), parameters()))
    K, R = 1 - 0.001 * 100, 1 + 0.00393 * 100
    per_current = [each["torque"][-1] / each["i_q"][-1] for each in (hot, cold)]
    assert per_current[0] / per_current[1] == pytest.approx(K, rel=1e-5)
    lost = [np.diff(each["E_copper"])[-1] / each["i_q"][-2:].mean() ** 2 for each in (hot, cold)]
    assert lost[0] / lost[1] == pytest.approx(R, rel=1e-3)


def test_diodes_rectify_a_back_emf_above_the_bus():
    """Without gate signals, above V/sqrt(3): square phase voltages against the current."""
    threshold = 24.0 / math.sqrt(3) / (4 * SERVO["psi"])
    assert threshold == pytest.approx(541.7, rel=1e-4)

    def steady(omega):
        par = parameters(inverter__gates=0.0, shaft__J=10.0, link__R_s=1e-3)
        found = simulate(run(par, omega=omega, duration=0.05))
        return [found[name][-200:].mean() for name in ("torque", "i_dc")]

    for omega in (0.5 * threshold, 0.95 * threshold):
        torque, i_dc = steady(omega)
        assert abs(torque) < 0.06 * 1.5 * 4 * SERVO["psi"] * 10.0
        assert -0.5 < i_dc < 0.0
    for omega in (3.0 * threshold, 4.0 * threshold):  # current flows in all phases all the time
        torque, i_dc = steady(omega)
        R, X, V = SERVO["R"], 4 * omega * L, 2 / math.pi * 24.0
        E = 4 * omega * SERVO["psi"]
        # (R i + V)^2 + (X i)^2 = E^2
        a, b, c = R * R + X * X, 2 * R * V, V * V - E * E
        i = (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a)
        assert torque == pytest.approx(-1.5 * (R * i + V) * i / omega, rel=5e-2)
        assert i_dc == pytest.approx(-3 / math.pi * i, rel=5e-2)


def test_field_weakening_that_is_lost_at_speed_brakes():
    """Gate signals end while field weakening drives the motor above its back-EMF limit."""
    par = parameters(current__k_fw=300.0, shaft__J=1e-3, inverter__V_f=0.7)
    lost = Change(0.02, par.replace({"inverter.gates": 0.0}))
    found = simulate(run(par, 2.0, 0.0, 650.0, duration=0.03, changes=(lost,)))
    before, after = found.time < 0.0199, found.time > 0.021
    assert found["torque"][before][-20:].mean() > 0.04
    assert found["i_d"][before][-1] < -3.0
    assert found["torque"][after].max() < -0.05
    assert found["i_dc"][after].mean() < -1.0
    assert residual(found) < 2e-4  # corners of the diodes at 10 us; 1e-6 at 1 us


BRAKING = {"shaft__J": 2e-5}


def test_a_regenerating_motor_lifts_a_bus_that_takes_no_current():
    """The capacitor receives the kinetic energy minus the copper loss."""
    runs = {
        name: simulate(run(parameters(**BRAKING, **link), -7.0, 0.0, 400.0, duration=0.02))
        for name, link in {
            "battery": {},
            "diode": {"link__law": "diode"},
            "chopper": {"link__law": "diode", "link__chopper": "resistor"},
        }.items()
    }
    top = {name: found["v_bus"].max() for name, found in runs.items()}
    assert top["battery"] == pytest.approx(24.0 + 0.05 * 7, abs=0.3)
    found = runs["diode"]
    kinetic = 0.5 * 2e-5 * (found["omega"][0] ** 2 - found["omega"][-1] ** 2)
    magnetic = 0.75 * L * (found["i_d"][-1] ** 2 + found["i_q"][-1] ** 2)
    to_link = kinetic - magnetic - found["E_copper"][-1] + found["E_source"][-1]
    stored = 0.5 * 2e-3 * (found["v_bus"][-1] ** 2 - 24.0**2)
    assert stored == pytest.approx(to_link - found["E_supply"][-1], rel=1e-4)
    assert 31.0 < top["chopper"] < top["diode"]
    x = dc_link.State(found["v_bus"])
    par = parameters(link__law="diode", link__V_most=32.0).link
    (text,) = dc_link.watch(found.time, x, par)
    assert "takes no current" in text
    assert dc_link.watch(found.time, dc_link.State(runs["battery"]["v_bus"]), par) == []


def test_a_chopper_below_the_supply_is_rejected():
    with raises(ParameterError, name="link.V_on", valid="> V_s"):
        parameters(link__chopper="resistor", link__V_on=20.0)


@pytest.mark.parametrize("i", [(-20.0, GRID[4]), (GRID[4], -20.0), (0.0, 0.0)])
def test_a_map_passes_through_its_tables(i):
    par = flux_map.Parameters.create(tables())
    assert flux_map.flux(flux_map.Currents(*i), par) == pytest.approx(map_of(*i), abs=1e-18)


def test_a_map_has_a_potential():
    """Coarse tables of a curve that is not a polynomial: the cross slopes stay equal."""

    def of_tanh(i_d, i_q):
        u = 1 / (1 + (i_q / 60) ** 2)
        return L * 20 * np.tanh(i_d / 20) * u, (
            L * i_q - L * 400 * np.log(np.cosh(i_d / 20)) * 2 * i_q / 3600 * u * u
        )

    par, h = flux_map.Parameters.create(tables(of_tanh, np.linspace(-20, 20, 9))), 1e-4
    for i in ((-7.3, 11.0), (14.9, -3.2), (25.0, 3.0)):
        at = flux_map.Currents(*i)
        W = [
            [flux_map.coenergy(flux_map.Currents(i[0] + a, i[1] + b), par) for b in (-h, 0, h)]
            for a in (-h, 0, h)
        ]
        found = flux_map.flux(at, par)
        assert found.psi_d == pytest.approx((W[2][1] - W[0][1]) / (2 * h), rel=1e-6)
        assert found.psi_q == pytest.approx((W[1][2] - W[1][0]) / (2 * h), rel=1e-6)
        if max(map(abs, i)) <= 20:
            assert found == pytest.approx(of_tanh(*i), rel=3e-3)


def test_unequal_cross_slopes_are_rejected():
    maps = tables()
    wrong = dict(maps, psi_q=tuple(1.5 * psi for psi in maps["psi_q"]))
    assert flux_map.Parameters.create(maps)
    wrong["psi_q"] = tuple(
        psi + 2e-5 * i_d for psi, i_d in zip(maps["psi_q"], np.repeat(GRID, 7), strict=True)
    )
    with raises(ParameterError, name="psi_q", value="0.003333 mH", valid="within"):
        flux_map.Parameters.create(wrong)


@pytest.mark.parametrize(
    ("name", "value", "valid"),
    [
        ("psi_d", (1e-3,), "of 49 nodes"),
        ("i_q", (0.0, 1.0, 0.5, 2.0, 3.0, 4.0, 5.0), "increasing"),
        ("psi_q", tuple(-psi for psi in tables()["psi_q"]), "increases with i_q"),
    ],
)
def test_tables_that_are_no_map_are_rejected(name, value, valid):
    with raises(ParameterError, name=name, valid=valid):
        flux_map.Parameters.create(tables() | {name: value})


def test_saturation_needs_a_map():
    with raises(ParameterError, name="motor.map.i_d", valid="saturated"):
        parameters(motor__law="saturated")


def test_currents_beyond_the_map_are_reported():
    par = saturated().motor
    x, t = pmsm.State(np.array([0.0, 0.0]), np.array([19.0, 21.0])), np.array([0.0, 1.0])
    (text,) = pmsm.watch(t, x, par)
    assert "i_q leaves the flux map" in text
