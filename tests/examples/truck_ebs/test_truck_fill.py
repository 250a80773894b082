"""A constant volume that the compiled brake fills, against an independent integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import bywire

FIXED = {  # the spring holds the rod, and the valve opens at once
    "chamber.V_0": "1 l",
    "chamber.F_s0": "20 kN",
    "stop.k_stop": "1e10 N/m",
    "relay.tau": "0.01 ms",
    "relay.overlap": "0",
    "relay.p_full": "0.001 bar",
    "ecu.control": "feedforward",
    "ecu.T_bus": "0 s",
    "ecu.T_s": "1 ms",
    "options.t_pedal": "0 s",
    "options.p_brake": "8.5 bar",
    "options.duration": "0.3 s",
    "simulation.record": "0.1 ms",
}


def independent(G_w: float, law: str) -> tuple[float, float]:
    """Return the time [s] to 5 bar gauge, and the temperature [K], from this test's equations."""
    p_s, p_a, V, C, b, rho_0, T_0 = 951_325.0, 101_325.0, 1e-3, 4e-8, 0.3, 1.185, 293.15
    R = 1e5 / (rho_0 * T_0)
    c_v = R / 0.4

    def rate(t: float, y: np.ndarray) -> list[float]:
        p, T = y
        r = p / p_s
        psi = 1.0 if r <= b else math.sqrt(max(1.0 - ((r - b) / (1.0 - b)) ** 2, 0.0))
        mdot = C * rho_0 * p_s * psi
        if law == "isothermal":
            return [R * T_0 * mdot / V, 0.0]
        m = p * V / (R * T)
        dT = (mdot * ((c_v + R) * T_0 - c_v * T) + G_w * (T_0 - T)) / (m * c_v)
        return [R * (mdot * T + m * dT) / V, dT]

    def arrived(t: float, y: np.ndarray) -> float:
        return float(y[0] - p_a - 5e5)

    arrived.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(rate, (0.0, 1.0), [p_a, T_0], events=arrived, rtol=1e-10, atol=1e-6)
    return float(found.t_events[0][0]), float(found.y[1, -1])


@pytest.mark.parametrize(
    ("law", "G_w", "time", "T"),
    [
        ("isothermal", 0.0, 134.876e-3, 293.15),
        ("heat", 0.0, 96.340e-3, 384.5),
        ("heat", 10.0, 101.06e-3, 370.5),
    ],
)
def test_the_brake_fills_a_volume_as_an_independent_integration(law, G_w, time, T):
    overrides = FIXED | {"volume.law": law}
    if law == "heat":
        overrides["volume.G_w"] = f"{G_w} W/K"
    run = bywire.run("ebs-response", overrides=overrides).recording
    t, p, reached = run["time"].values, run["p"].values, independent(G_w, law)
    assert reached == pytest.approx((time, T), rel=2e-3)
    at = float(np.interp(5e5, p, t))
    delay = 20e-6  # the spool opens within the first step
    assert at - delay == pytest.approx(reached[0], rel=3e-4)
    if law == "heat":
        assert float(np.interp(at, t, run["T"].values)) == pytest.approx(reached[1], rel=3e-4)
