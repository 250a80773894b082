"""Synchronous motor, inverter and field-oriented control against closed forms.

The runs integrate the elements' equations with an independent fourth-order method.
"""

import math

import numpy as np
import pytest

from bywire.control import derating, speed_observer
from bywire.control import field_oriented as foc
from bywire.plant import inverter, pmsm

SERVO = {"p": 4.0, "R": 0.36, "L_d": 0.2e-3, "L_q": 0.2e-3, "psi": 6.395e-3}  # Teknic M-2310P
TRACTION = {"p": 3.0, "R": 18e-3, "L_d": 0.37e-3, "L_q": 1.2e-3, "psi": 66e-3}
IRON = {"iron": "off", "c_h": 0.0, "c_e": 0.0}
T = 1e-4
SUBSTEPS = 10
POWER_STAGE = {
    "law": "ideal",
    "f_s": 10e3,
    "t_d": 1e-6,
    "V_f": 0.0,
    "i_th": 0.05,
    "gates": 1.0,
    "i_off": 1.0,
}


NO_MAP = {f"map.{name}": () for name in ("i_d", "i_q", "psi_d", "psi_q")}


def motor(values):
    return pmsm.Parameters.create({"law": "linear"} | NO_MAP | IRON | values)


def law(values, **changes):
    own = {
        "omega_c": 1 / (3 * T),
        "R_a": 0.0,
        "p": values["p"],
        "R_hat": values["R"],
        "L_d_hat": values["L_d"],
        "L_q_hat": values["L_q"],
        "psi_hat": values["psi"],
        "lead": 1.5,
        "i_max": 240.0,
        "voltage": "circle",
        "k_fw": 0.0,
        "reserve": 0.95,
    }
    return foc.Parameters.create(own | changes)


class Run:
    """Run of motor, inverter and control at constant speed, with voltages one tick late."""

    V_dc = 24.0

    def __init__(
        self,
        values,
        i_ref,
        omega=0.0,
        stage=None,
        ticks=60,
        offset=0.0,
        i_fw=0.0,
        start=None,
        **own,
    ):
        self.par, self.law = motor(values), law(values, **own)
        self.stage = inverter.Parameters.create(POWER_STAGE | (stage or {}))
        self.omega = omega
        emf = values["p"] * omega * values["psi"]
        # It starts without current: the voltage equals the back EMF, in the middle of each sample.
        held = [self._at_start(emf, k) for k in (-1.5, -0.5)]
        x, state = start or pmsm.State(0.0, 0.0), foc.State(0.0, 0.0, i_fw)
        rows, waiting = [], held[1]
        self.power_in = self.copper = self.shaft = self.lost = 0.0
        for k in range(ticks):
            theta = self._theta(k * T)
            c, s = math.cos(theta), math.sin(theta)
            u = foc.Input(
                i_ref,
                c * x.i_d - s * x.i_q,
                s * x.i_d + c * x.i_q,
                theta + offset,
                omega,
                self.V_dc,
                240.0,
            )
            acting = waiting
            state, out = foc.output(state, u, T, self.law)
            waiting = (out.v_alpha, out.v_beta)
            for n in range(SUBSTEPS):
                t = k * T + n * T / SUBSTEPS
                rows.append((t, *x))
                x = self._step(x, t, T / SUBSTEPS, acting)
        self.t, self.i_d, self.i_q = np.array(rows).T
        self.end = x

    def _at_start(self, emf, k):
        middle = self._theta((k + 1.0) * T)
        return -emf * math.sin(middle), emf * math.cos(middle)

    def _theta(self, t):
        return self.par.p * self.omega * t

    def _voltages(self, x, t, held):
        u = inverter.Input(*held, *x, self._theta(t), self.V_dc)
        return inverter.output(u, self.stage), inverter.power_loss(u, self.stage)

    def _rate(self, y, t, held):
        x = pmsm.State(*y[:2])
        out, lost = self._voltages(x, t, held)
        u = pmsm.Input(out.v_d, out.v_q, self.omega)
        f, b = pmsm.mass(x, self.par), pmsm.balance(x, u, self.par)
        energies = (
            out.i_dc * self.V_dc,
            pmsm.power_loss(x, self.par),
            pmsm.airgap_torque(x, self.par) * self.omega,
            lost,
        )
        return np.array([b.i_d / f.i_d, b.i_q / f.i_q, *energies])

    def _step(self, x, t, h, held):
        y = np.array([*x, self.power_in, self.copper, self.shaft, self.lost])
        k_1 = self._rate(y, t, held)
        k_2 = self._rate(y + h / 2 * k_1, t + h / 2, held)
        k_3 = self._rate(y + h / 2 * k_2, t + h / 2, held)
        k_4 = self._rate(y + h * k_3, t + h, held)
        y = y + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
        self.power_in, self.copper, self.shaft, self.lost = y[2:]
        return pmsm.State(*y[:2])

    def rise(self, share, final):
        """Return the time [s] of a fraction of the final current across the magnets."""
        k = int(np.argmax(self.i_q >= share * final))
        t, i = self.t[k - 1 : k + 1], self.i_q[k - 1 : k + 1]
        return float(np.interp(share * final, i, t))


def test_a_current_step_at_rest():
    run = Run(SERVO, 7.0)
    assert run.rise(0.1, 7.0) == pytest.approx(131e-6, rel=1e-2)
    assert run.rise(0.9, 7.0) == pytest.approx(449e-6, rel=1e-2)
    assert 100 * (max(run.i_q) / 7.0 - 1) == pytest.approx(4.55, rel=1e-2)
    assert max(abs(run.i_d)) < 1e-12


def test_a_current_step_at_speed():
    run = Run(SERVO, 5.0, 200.0)
    assert run.rise(0.9, 5.0) == pytest.approx(453e-6, rel=2e-2)
    assert 100 * (max(run.i_q) / 5.0 - 1) == pytest.approx(5.3, rel=2e-2)
    assert max(abs(run.i_d)) == pytest.approx(0.33, rel=3e-2)


@pytest.mark.parametrize(("omega", "overshoot"), [(200.0, 10.8), (350.0, 28.8)])
def test_without_lead_the_delay_turns_the_voltage(omega, overshoot):
    run = Run(SERVO, 5.0, omega, lead=0.0)
    assert 100 * (max(run.i_q) / 5.0 - 1) == pytest.approx(overshoot, rel=3e-2)


@pytest.mark.parametrize(("omega", "i"), [(0.0, 38.490), (200.0, 22.907), (350.0, 12.393)])
def test_the_largest_current_at_a_voltage(omega, i):
    V, par = inverter.largest_voltage(24.0), motor(SERVO)
    u = pmsm.Input(-par.p * omega * par.L_q * i, 0.0, omega)
    x = pmsm.State(0.0, i)
    v_q = -pmsm.balance(x, u, par).i_q
    assert math.hypot(u.v_d, v_q) == pytest.approx(V, rel=1e-3)


@pytest.mark.parametrize(
    ("degrees", "share", "i_d"), [(4, 0.99756, -0.4883), (15, 0.96593, -1.8117)]
)
def test_an_angle_error_turns_the_current(degrees, share, i_d):
    run = Run(SERVO, 7.0, ticks=200, offset=-math.radians(degrees))
    torque = pmsm.airgap_torque(run.end, run.par)
    assert torque / (1.5 * 4 * SERVO["psi"] * 7.0) == pytest.approx(share, rel=1e-4)
    assert abs(run.end.i_d) == pytest.approx(abs(i_d), rel=1e-4)


def test_dead_time_takes_voltage_along_the_current():
    stage = inverter.Parameters.create(POWER_STAGE | {"law": "dead time", "i_th": 1e-6})
    angles = np.linspace(0.0, 2 * math.pi, 7201)[:-1]
    drops = [
        inverter.output(inverter.Input(0.0, 0.0, 0.0, 5.0, a, 24.0), stage).v_q for a in angles
    ]
    assert np.mean(drops) == pytest.approx(-4 / math.pi * 24.0 * 1e-6 * 10e3, rel=1e-3)
    assert -np.mean(drops) == pytest.approx(0.3056, rel=1e-2)


@pytest.mark.parametrize(
    ("amplitude", "i_d", "i_q", "torque"),
    [(120.0, -67.27, 99.37, 54.48), (240.0, -150.99, 186.56, 160.61)],
)
def test_interior_magnets_use_their_reluctance(amplitude, i_d, i_q, torque):
    ref = foc.set_points(amplitude, 0.0, 240.0, 1.0, law(TRACTION))[:2]
    assert ref == pytest.approx((i_d, i_q), rel=1e-3)
    assert pmsm.airgap_torque(pmsm.State(*ref), motor(TRACTION)) == pytest.approx(torque, rel=1e-3)
    negative = foc.set_points(-amplitude, 0.0, 240.0, 1.0, law(TRACTION))[:2]
    assert negative == (ref[0], -ref[1])


def test_the_base_speed_of_a_traction_motor():
    par, omega = motor(TRACTION), 253.33
    x = pmsm.State(-150.99, 186.56)
    zero = pmsm.balance(x, pmsm.Input(0.0, 0.0, omega), par)
    V = math.hypot(zero.i_d, zero.i_q)
    assert pytest.approx(inverter.largest_voltage(300.0), rel=1e-3) == V


def test_field_weakening_reaches_a_speed_beyond_the_back_emf():
    beyond = {"ticks": 600, "k_fw": 300.0, "i_max": 10.04, "reserve": 0.95}
    weakened = Run(SERVO, 2.0, 560.0, **beyond)
    plain = Run(SERVO, 2.0, 560.0, ticks=600, i_max=10.04)
    assert inverter.largest_voltage(24.0) / (4 * SERVO["psi"]) < 560.0  # 541.7 rad/s
    assert weakened.end.i_q == pytest.approx(2.0, abs=0.05)
    assert weakened.end.i_d < -1.0
    assert plain.end.i_q < 0.5


def test_a_stalled_motor_keeps_its_field():
    """The resistance, and not the magnets, needs the voltage above the reserve."""
    run = Run(SERVO, 38.0, ticks=600, k_fw=300.0, i_max=40.0)
    assert SERVO["R"] * 38.0 > 0.95 * inverter.largest_voltage(24.0)
    assert run.end.i_q == pytest.approx(38.0, abs=0.1)
    assert abs(run.end.i_d) < 0.1


@pytest.mark.parametrize("stage", [{}, {"law": "dead time", "V_f": 0.4}])
def test_power_is_balanced(stage):
    run = Run(SERVO, 5.0, 200.0, stage)
    stored = pmsm.energy(run.end, run.par)
    out = run.copper + run.shaft + run.lost + stored  # within the error of the method
    assert run.power_in == pytest.approx(out, rel=1e-6)
    assert (run.lost > 0.01) == bool(stage)


def largest_torque(omega, i_max=240.0, V_dc=300.0):
    """Return the largest torque and its currents within the circles of current and voltage."""
    par, V = motor(TRACTION), inverter.largest_voltage(V_dc)
    best = (0.0, 0.0, 0.0)
    center, span = (-120.0, 120.0), 120.0
    for _ in range(8):  # a grid that closes in on the best currents
        for i_d in np.linspace(center[0] - span, center[0] + span, 41):
            for i_q in np.linspace(center[1] - span, center[1] + span, 41):
                x = pmsm.State(i_d, i_q)
                v = pmsm.balance(x, pmsm.Input(0.0, 0.0, omega), par)
                if math.hypot(v.i_d, v.i_q) <= V and math.hypot(i_d, i_q) <= i_max:
                    best = max(best, (pmsm.airgap_torque(x, par), i_d, i_q))
        center, span = best[1:], span / 3.0
    return best


@pytest.mark.parametrize(
    ("rpm", "torque", "i_d", "i_q"), [(6000, 84.33, -228.5, 73.3), (12000, 39.43, -221.4, 35.1)]
)
def test_the_largest_torque_at_high_speed(rpm, torque, i_d, i_q):
    best = largest_torque(rpm * math.pi / 30)
    assert best[0] == pytest.approx(torque, rel=2e-3)
    assert best[1:] == pytest.approx((i_d, i_q), abs=1.0)


class Traction(Run):
    """The traction motor, whose field weakening regulates the voltage to 300 V / sqrt(3)."""

    V_dc = 300.0 / 0.95


@pytest.mark.parametrize(("rpm", "torque"), [(6000, 84.33), (12000, 39.43)])
def test_field_weakening_finds_the_largest_torque(rpm, torque, monkeypatch):
    """The circle of the current limits it at 6000 rpm, and the voltage alone (MTPV) at 12000."""
    monkeypatch.setattr("test_pmsm.T", 2.5e-5)  # held voltages turn by 5 degrees
    monkeypatch.setattr("test_pmsm.SUBSTEPS", 2)
    near = pmsm.State(-220.0, 60.0)
    more = {"k_fw": 600.0, "i_max": 240.0, "reserve": 0.95, "i_fw": -70.0, "start": near}
    run = Traction(TRACTION, 240.0, rpm * math.pi / 30, ticks=4000, **more)
    last = [pmsm.State(*x) for x in zip(run.i_d[-800:], run.i_q[-800:], strict=True)]
    found = np.mean([pmsm.airgap_torque(x, run.par) for x in last])
    assert found == pytest.approx(torque, rel=2e-3)
    assert max(math.hypot(*x) for x in last) < 240.5
    assert max(x.i_d for x in last) < -TRACTION["psi"] / TRACTION["L_d"]


def test_maximum_torque_per_voltage():
    """Without resistance, no other currents of the same flux give more torque."""
    par, limit = law(TRACTION), 0.045
    psi_d = par.psi_hat + par.L_d_hat * foc.weakest_field(limit, par)
    angles = np.linspace(-math.pi, math.pi, 200001)
    d, q = limit * np.cos(angles), limit * np.sin(angles)
    other = (d - par.psi_hat) / par.L_d_hat, q / par.L_q_hat
    best = np.argmax((par.psi_hat + (par.L_d_hat - par.L_q_hat) * other[0]) * other[1])
    assert psi_d == pytest.approx(d[best], abs=1e-6)
    surface = law(SERVO)
    assert foc.weakest_field(limit, surface) == pytest.approx(-SERVO["psi"] / SERVO["L_d"])


def test_set_points_follow_field_weakening_without_jumps():
    par = law(TRACTION)
    currents = np.array(
        [foc.set_points(120.0, -i, 200.0, 0.046, par)[:2] for i in np.linspace(0.0, 400.0, 4001)]
    )
    assert np.abs(np.diff(currents, axis=0)).max() < 6.4  # the slope of the circle at its end
    assert np.hypot(*currents.T).max() <= 200.0 * (1 + 1e-12)
    assert currents[-1, 1] == 0.0


def test_a_derated_limit_lowers_the_current():
    cold = {"T_ref_hat": 293.15, "T_a_hat": 293.15, "T_derate": 373.15, "T_limit": 423.15}
    thermal = derating.Parameters.create(
        cold
        | {"law": "current", "R_hat": 0.36, "a_R_hat": 0.00393, "C_w_hat": 15.0}
        | {"C_h_hat": 150.0, "G_wh_hat": 1 / 3, "G_ha_hat": 0.5, "i_least": 2.0}
    )
    warm = derating.State(105.0, 80.0)  # halfway between T_derate and T_limit
    limit = derating.output(warm, derating.Input(0.0, 10.0), 1e-9, thermal)[1].i_max
    assert limit == pytest.approx(6.0)
    assert foc.set_points(10.0, 0.0, limit, 1.0, law(SERVO))[:2] == pytest.approx((0.0, limit))


def test_a_voltage_of_zero_has_no_direction():
    u = foc.Input(0.0, 0.0, 0.0, 0.3, 0.0, 24.0, 10.0)
    for voltage in ("circle", "hexagon"):
        state, out = foc.output(foc.State(0.0, 0.0, 0.0), u, T, law(SERVO, voltage=voltage))
        assert (out.v_alpha, out.v_beta, *state) == (0.0, 0.0, 0.0, 0.0, 0.0)


def test_the_hexagon_reaches_six_steps():
    angles = np.linspace(0.0, 2 * math.pi, 3601)[:-1]

    def fundamental(size):
        v = np.array([foc.hexagon(size * math.cos(a), size * math.sin(a), 24.0) for a in angles])
        return (v @ [1, 1j] * np.exp(-1j * angles)).mean()

    assert fundamental(13.8) == pytest.approx(13.8, rel=1e-12)  # within V/sqrt(3) = 13.856 V
    assert abs(fundamental(1e5)) == pytest.approx(2 / math.pi * 24.0, rel=1e-4)
    assert foc.hexagon(16.0, 0.0, 24.0) == pytest.approx((16.0, 0.0))  # a corner, 2/3 V


def test_the_hexagon_gives_more_current_at_speed():
    amount = {"ticks": 400, "i_max": 40.0}
    circle, hexagon = (
        Run(SERVO, 40.0, 350.0, voltage=name, **amount) for name in ("circle", "hexagon")
    )
    assert hexagon.i_q[-1000:].mean() > 1.15 * circle.i_q[-1000:].mean()


def test_an_observer_of_the_speed_is_quiet_and_lags_as_stated():
    par = speed_observer.Parameters.create({"omega_o": 500.0, "turn": 2 * math.pi})

    def estimate(angles, x):
        found = []
        for theta in angles:
            x, out = speed_observer.output(x, speed_observer.Input(theta), T, par)
            found.append(out.omega)
        return np.array(found)

    t = np.arange(2000) * T
    start = speed_observer.State(-100.0 * T, 100.0)
    turning = (100.0 * t) % (2 * math.pi)  # a resolver that starts again after each turn
    assert estimate(turning, start) == pytest.approx(np.full(t.size, 100.0), rel=1e-9)
    count = 2 * math.pi / 4096
    rounded = count * np.floor(turning / count + 0.5)
    assert np.abs(np.diff(rounded)[:50] / T - 100.0).max() > 7.0
    assert np.abs(estimate(rounded, start) - 100.0).max() < 1.0
    accelerating = estimate(0.5 * 1e4 * t**2, speed_observer.State(0.0, 0.0))
    lag = (1e4 * t[-1] - accelerating[-1]) / 1e4
    assert lag == pytest.approx(2 / par.omega_o, rel=0.03)


def test_active_damping_speeds_up_the_rejection_of_disturbances():
    """An error of the flux linkage decays with L/R = 67 ms, or with L/(R + R_a) = 2.3 ms."""
    wrong, left = 0.95 * TRACTION["psi"], {}
    for R_a in (0.0, 0.5):
        run = Traction(TRACTION, 10.0, 100.0, ticks=120, psi_hat=wrong, R_a=R_a, i_max=240.0)
        left[R_a] = abs(run.end.i_q - foc.set_points(10.0, 0.0, 240.0, 1.0, run.law).i_q)
    peak = 3 * 100.0 * 0.05 * TRACTION["psi"] / (TRACTION["L_q"] / (3 * T))  # voltage over k_p
    assert left[0.0] == pytest.approx(peak * math.exp(-0.012 / 0.067), rel=0.1)
    assert left[0.5] < 0.03 * peak
