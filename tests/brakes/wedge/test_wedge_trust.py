"""Forces, stiffness and clearance of the wedge brake's contacts."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from wedge_runs import FRICTIONLESS, IDEAL, TAN_ALPHA, brake, drive

import bywire
from bywire.brakes.wedge.elements import brake_heart
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at
from bywire.core.signals import zeros
from bywire.plant import roller_screw
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, simulate

STATES = 20_000
STIFF = ("heart.K_S", "heart.K_W", "heart.K_C", "caliper.K_cal")
DAMPING = ("heart.tau_heart", "caliper.tau_cal")


def scaled(par, names, factor):
    return par.replace({name: factor * par.leaves()[name] for name in names})


def random_parameters(random):
    """Return one value per state of each parameter [SI], by name."""
    par = brake()
    values = {name: np.full(STATES, value) for name, value in par.leaves().items()}
    for name in (*STIFF, *DAMPING):
        values[name] *= 10.0 ** random.uniform(-1.0, 1.0, STATES)
    for name in ("heart.g_1", "heart.g_2", "heart.g_12"):
        values[name] = random.uniform(0.0, 60e-6, STATES)
    return par, values


def random_states(random, k):
    """Return moving states near contact, with the wedge on either side and the screws near it."""
    x = random.uniform(-1.2e-3, 1.2e-3, STATES)
    X_1, X_2 = x + random.normal(0.0, 60e-6, (2, STATES))
    V_1, V_2, v = random.normal(0.0, 0.5, (3, STATES))
    state = zeros(WedgeBrake.State)._replace(
        theta_1=X_1 / k,
        theta_2=X_2 / k,
        omega_1=V_1 / k,
        omega_2=V_2 / k,
        x=x,
        v=v,
        Omega=random.choice([-60.0, 60.0], STATES),
        phi=random.uniform(0.0, 6.0, STATES),
    )
    return WedgeBrake.State(*(one + np.zeros(STATES) for one in state))


def problem(s, p, k):
    """Return compliance and overlap of heart and caliper as the paper's equations say."""
    t_h, t_c = p["heart.tau_heart"], p["caliper.tau_cal"]
    X_1, X_2 = k * (s.theta_1 + t_h * s.omega_1), k * (s.theta_2 + t_h * s.omega_2)
    w = s.x + t_h * s.v
    runout = p["flywheel.runout"] * (np.sin(s.phi) + t_c * s.Omega * np.cos(s.phi))
    pressed = np.sign(s.x) * (s.x + t_c * s.v) * TAN_ALPHA - p["caliper.clearance"] + runout
    d = np.stack(
        [w - X_1 - p["heart.g_1"], X_2 - w - p["heart.g_2"], X_1 - X_2 - p["heart.g_12"], pressed],
        axis=1,
    )
    screw, wedge = 1.0 / p["heart.K_S"], 1.0 / p["heart.K_W"]
    C = np.zeros((STATES, 4, 4))
    C[:, 0, 0] = C[:, 1, 1] = screw + wedge
    C[:, 2, 2] = 2.0 * screw + 1.0 / p["heart.K_C"]
    C[:, 0, 2] = C[:, 2, 0] = C[:, 1, 2] = C[:, 2, 1] = -screw
    C[:, 3, 3] = 1.0 / p["caliper.K_cal"]
    return C, d


def by_brute_force(C, d):
    """Return the forces of the subset of contacts that violates its conditions least."""
    n = d.shape[1]
    least, forces = np.full(len(d), np.inf), np.zeros(d.shape)
    for rows in (list(s) for size in range(n + 1) for s in itertools.combinations(range(n), size)):
        f = np.zeros(d.shape)
        if rows:
            f[:, rows] = np.linalg.solve(C[:, rows][:, :, rows], d[:, rows, None])[..., 0]
        overlap = (d - np.einsum("nij,nj->ni", C, f)) / np.einsum("nii->ni", C)
        violation = np.maximum(-f, overlap).max(axis=1)
        better = violation < least
        least[better], forces[better] = violation[better], f[better]
    assert least.max() < 1e-9 * forces.max()
    return forces


def test_contact_forces_solve_the_complementarity_problem():
    """What the engine records at 20,000 random states, against every subset of the contacts."""
    random = np.random.default_rng(3)
    par, values = random_parameters(random)
    k = roller_screw.slope(par.screw)
    state = random_states(random, k)
    C, d = problem(state, values, k)
    expected = by_brute_force(C, d)
    pressed = {tuple(row) for row in expected > 0.0}
    assert len(pressed) == 14  # every set but three at once in the heart, whose free-plays add up

    program = prepare(WedgeBrake(), par).program
    x, p = np.stack(state), np.stack([values[name] for name in program.parameter_names])
    memory = np.array(memory_at(0.0, par))[:, None]
    still = [np.zeros((n, STATES)) for n in (program.sizes.reaction, program.sizes.flow)]
    step = np.full(STATES, 1e-15)
    shown = np.array(program.output.map(STATES)(x, np.tile(memory, STATES), p, *still, step))
    found = shown[[list(program.outputs).index(name) for name in ("f_1", "f_2", "f_12", "F_N")]].T
    assert np.abs(found - expected).max() < 1e-9 * expected.max()


def test_closed_form_of_the_energies_solves_it_too():
    """At overlaps as no free-plays allow them, with all three contacts at once."""
    random = np.random.default_rng(4)
    par, values = random_parameters(random)
    k = roller_screw.slope(par.screw)
    C = problem(random_states(random, k), values, k)[0][:, :3, :3]
    d = random.uniform(-60e-6, 60e-6, (STATES, 3))
    expected = by_brute_force(C, d)
    assert np.count_nonzero((expected > 0.0).all(axis=1)) > 1000
    found = brake_heart.solve(brake_heart.Overlaps(*d.T), par.with_leaves(values).heart)
    assert np.abs(np.stack(found, axis=1) - expected).max() < 1e-9 * expected.max()


def rattle(base, factor, damping, step):
    """Return a run in which pads and screws come and go twenty times a second, no preload."""
    par = scaled(scaled(brake(base), STIFF, factor), DAMPING, damping)
    par = par.replace({"command.mode": "position", "control.offset.delta_preload": 0.0})
    fields = WedgeBrake.Stimulus._fields

    def rows(t):
        found = np.zeros((t.size, len(fields)))
        for name in ("theta_1_set", "theta_2_set"):
            found[:, fields.index(name)] = 1.75 + 0.4 * np.sin(40.0 * math.pi * t)
        return found

    start = state_at(0.0, par)
    return simulate(Run(WedgeBrake(), par, start, memory_at(0.0, par), rows, 0.15, step))


@pytest.fixture(scope="module")
def rattles():
    """Return error against steps ten times finer, and whether the run doubts itself, by case."""
    found = {}
    cases = [(1.0, 1.0), (10.0, 1.0), (100.0, 1.0), (100.0, 0.1), (100.0, 0.0)]
    for (label, base), case in itertools.product(
        {"friction": IDEAL, "none": FRICTIONLESS}.items(), cases
    ):
        coarse, fine = (rattle(base, *case, step) for step in (20e-6, 2e-6))
        error = max(
            np.abs(coarse[name] - fine[name]).max() / np.ptp(fine[name])
            for name in ("theta_1", "theta_2", "x", "M_B")
        )
        found[(label, *case)] = (error, coarse.status == "unsettled" or coarse.doubt != "")
    return found


def test_stiff_contacts_are_right_or_doubted(rattles):
    for case, (error, doubted) in rattles.items():
        assert error < 0.01 or doubted, case


def test_the_damping_of_the_set_keeps_stiffer_contacts_right(rattles):
    for (label, factor, damping), (error, doubted) in rattles.items():
        if damping == 1.0:
            assert error < 0.01, (label, factor)
            assert not doubted, (label, factor)


def test_without_the_doubt_a_wrong_result_would_be_silent(rattles):
    """How wrong is chance: 4 % or 20 %, as the last digits of a substep fall."""
    error, doubted = rattles["none", 100.0, 0.0]
    assert error > 0.01
    assert doubted


def test_the_doubt_is_said_by_the_bench():
    base = brake()
    stiff = {name: 100.0 * base.leaves()[name] for name in STIFF} | dict.fromkeys(DAMPING, 0.0)
    result = bywire.run(bywire.Bench("moment-pulses", "roberts2003", overrides=stiff))
    assert any("oscillates at" in warning for warning in result.warnings)


def contact_changes(preload, step=20e-6):
    par = brake(FRICTIONLESS | {"control.offset.delta_preload": preload}, TAN_ALPHA)
    run = drive(par, 0.6, step, 20e-6, M_set=lambda t: 500.0 + 0.0 * t)
    return np.count_nonzero(np.diff(run["contacts"]))


def test_free_play_at_the_neutral_point():
    """A limit cycle without preload, 96 changes of contact in 0.6 s; with it, a single one.

    The trial counted 351 and 2. Here the cycle turns 36 times a second, with four changes each;
    step, moment, runout, cogging and encoder leave it as it is, a faster position control gives
    more: 126 changes at 100 Hz.
    """
    loose = contact_changes(0.0)
    assert loose == pytest.approx(96, abs=8)
    assert abs(contact_changes(0.0, 5e-6) - loose) <= 4
    assert contact_changes(42e-6) <= 2
