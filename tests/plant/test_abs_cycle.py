"""An anti-lock cycle on brake fluid: volumes and energies of valves, caliper and accumulator."""

import numpy as np
import pytest

from bywire.plant import accumulator, brake_fluid, check_valve, orifice, stiffening_caliper
from systems import fluids

BAR, CM3 = 1e5, 1e-6
FLUID = brake_fluid.Parameters.create(fluids.STIFF)
INLET, OUTLET, RETURN = (
    orifice.Parameters.create({"d": d, "C_d": 0.65, "Re_cr": 100.0})
    for d in (0.5e-3, 0.6e-3, 1.2e-3)
)
CHECK = check_valve.Parameters.create(
    {"seat.d": RETURN.d, "seat.C_d": 0.65, "seat.Re_cr": 100.0, "p_crack": 0.0}
)
CALIPER = stiffening_caliper.Parameters.create(
    {"V_1": 0.35 * CM3, "p_1": 4 * BAR, "c": 0.011 * CM3 / BAR}
)
STORE = accumulator.Parameters.create(
    {"p_0": 1.5 * BAR, "k": BAR / CM3, "V_max": 3.5 * CM3, "c_stop": 4e-15}
)
P_MASTER, PUMP = 120 * BAR, 3.318 * CM3
DELAY, TAU = 1e-3, 1e-3
STEP = 20e-6


def commands(t):
    """Return whether inlet and outlet are commanded open: fill, then release, hold and pulses."""
    t = t - DELAY
    if t < 0.15:
        return float(t >= 0.0), 0.0
    phase = (t - 0.15) % 0.1
    if phase < 0.02:
        return 0.0, 1.0
    if phase < 0.04:
        return 0.0, 0.0
    return float((phase - 0.04) % 0.015 < 0.006), 0.0


@pytest.fixture(scope="module")
def cycle():
    """Return the histories of the cycle by name, integrated with the midpoint rule."""

    def rate(y, t):
        p, V, lift_in, lift_out = y[:4]
        p = max(p, 0.0)
        opened = commands(t)
        q_in = orifice.flow(orifice.Input(P_MASTER, p, lift_in), INLET, FLUID)
        q_back = check_valve.flow(check_valve.Input(p, P_MASTER), CHECK, FLUID)
        p_store = accumulator.pressure(accumulator.State(V), STORE, FLUID)
        q_out = orifice.flow(orifice.Input(p, p_store, lift_out), OUTLET, FLUID)
        q_pump = PUMP if V > 1e-4 * CM3 else min(PUMP, max(q_out, 0.0))
        f = stiffening_caliper.mass(stiffening_caliper.State(p), CALIPER)
        losses = q_in * (P_MASTER - p) + q_out * (p - p_store)
        return np.array(
            [
                (q_in - q_back - q_out) / f,
                q_out - q_pump,
                (opened[0] - lift_in) / TAU,
                (opened[1] - lift_out) / TAU,
                q_in - q_back,
                q_pump,
                P_MASTER * (q_in - q_back),
                losses,
                p_store * q_pump,
            ]
        )

    y, rows = np.zeros(9), []
    for k in range(round(0.95 / STEP)):
        rows.append((k * STEP, *y))
        middle = y + 0.5 * STEP * rate(y, k * STEP)
        y = y + STEP * rate(middle, (k + 0.5) * STEP)
        y[1] = max(y[1], 0.0)
    rows.append((0.95, *y))
    names = ("t", "p", "V", "in", "out", "given", "pumped", "work", "lost", "sucked")
    return dict(zip(names, np.array(rows).T, strict=True))


def test_the_pressure_swings_between_its_ends(cycle):
    late = cycle["p"][cycle["t"] > 0.45]
    assert late.min() / BAR == pytest.approx(35.9, rel=0.02)
    assert late.max() / BAR == pytest.approx(76.7, rel=0.02)


def test_no_fluid_is_lost(cycle):
    p = stiffening_caliper.State(cycle["p"][-1])
    wheel = stiffening_caliper.volume(p, CALIPER)
    parts = [wheel, cycle["V"][-1], cycle["pumped"][-1]]
    assert sum(parts) == pytest.approx(cycle["given"][-1], abs=2e-4 * CM3)
    found = np.array([cycle["given"][-1], cycle["pumped"][-1], cycle["V"][-1], wheel]) / CM3
    assert found == pytest.approx([4.208, 2.653, 0.467, 1.089], rel=0.01)
    assert cycle["V"].max() / CM3 == pytest.approx(0.720, rel=0.01)


def test_energy_is_balanced(cycle):
    p = stiffening_caliper.State(cycle["p"][-1])
    wheel = stiffening_caliper.energy(p, CALIPER, FLUID)
    store = accumulator.energy(accumulator.State(cycle["V"][-1]), STORE, FLUID)
    found = [cycle["work"][-1], wheel, cycle["lost"][-1], store, cycle["sucked"][-1]]
    assert found[:4] == pytest.approx([50.497, 2.620, 47.277, 0.081], rel=0.01)
    assert found[4] == pytest.approx(0.520, rel=0.02)  # depends on how the pump sucks it empty
    assert sum(found[1:]) == pytest.approx(found[0], rel=1e-4)
