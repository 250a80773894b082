"""Contact forces versus brute-force solutions of the complementarity problem, including ties."""

from __future__ import annotations

from itertools import chain, combinations

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.simulation.contacts import active_stiffness
from bywire.simulation.run import simulate
from reference.plain_stepping import solve_contacts
from systems import three_contacts
from systems.three_contacts import heart
from systems.two_mass import rig

Array = NDArray[np.float64]
COUNT = 5000


def engine_forces(C: Array, d: Array) -> Array:
    """Return the forces from the engine, shape (count, n)."""
    count, n = d.shape
    Cs, ds = ca.SX.sym("C", n, n), ca.SX.sym("d", n)
    one = ca.Function("one", [Cs, ds], [active_stiffness(Cs, ds) @ ds])
    return np.array(one.map(count)(ca.DM(np.hstack(list(C))), ca.DM(d.T))).T


def brute_forces(C: Array, d: Array) -> Array:
    """Return the forces of the subset that leaves the smallest violation, tried one by one."""
    count, n = d.shape
    best, forces = np.full(count, np.inf), np.zeros((count, n))
    for subset in map(list, chain.from_iterable(combinations(range(n), k) for k in range(n + 1))):
        F = np.zeros((count, n))
        if subset:
            block = C[:, subset][:, :, subset]
            F[:, subset] = np.linalg.solve(block, d[:, subset][..., None])[..., 0]
        gap = np.einsum("nij,nj->ni", C, F) - d
        violation = np.maximum(-F, -gap / np.einsum("nii->ni", C)).max(axis=1)
        better = violation < best - 1e-12
        best[better], forces[better] = violation[better], F[better]
    assert best.max() < 1e-9 * np.abs(forces).max()
    return forces


def random_groups(n: int, seed: int) -> tuple[Array, Array]:
    """Return positive definite compliances, weakly to strongly coupled, and overlaps."""
    rng = np.random.default_rng(seed)
    root = np.eye(n) + rng.uniform(0.0, 1.5, (COUNT, 1, 1)) * rng.normal(size=(COUNT, n, n))
    return root @ root.transpose(0, 2, 1) + 0.05 * np.eye(n), rng.normal(size=(COUNT, n))


def heart_groups(seed: int) -> tuple[Array, Array]:
    """Return the wedge brake's compliances in m/MN, and overlaps in m of random positions."""
    C = 1e6 * np.array(three_contacts.ThreeContacts().compliance(three_contacts.PARAMETERS)[0])
    X_1, X_2, x = np.random.default_rng(seed).normal(scale=50e-6, size=(3, COUNT))
    d = np.stack([x - X_1 - 20e-6, X_2 - x - 20e-6, X_1 - X_2 - 30e-6], axis=1)
    return np.broadcast_to(C, (COUNT, 3, 3)), d / 1e-6


@pytest.mark.parametrize("n", [1, 2, 3])
def test_random_groups(n: int) -> None:
    C, d = random_groups(n, 10 + n)
    forces = engine_forces(C, d)
    expected = brute_forces(C, d)
    np.testing.assert_allclose(forces, expected, atol=1e-9 * np.abs(expected).max())
    sets = {tuple(row) for row in (expected > 0.0).astype(int)}
    assert len(sets) == 2**n  # every subset occurred


def test_heart_of_the_wedge_brake() -> None:
    C, d = heart_groups(3)
    forces = engine_forces(C, d)
    expected = brute_forces(C, d)
    np.testing.assert_allclose(forces, expected, atol=1e-9 * np.abs(expected).max())
    active = np.count_nonzero(expected > 0.0, axis=1)
    assert set(active) == {0, 1, 2}  # the free-plays add up: never all three


def test_exact_ties() -> None:
    """If a contact just touches, several subsets are correct, and none may lose the force."""
    C, _ = random_groups(3, 5)
    rng = np.random.default_rng(6)
    forces = np.where(rng.random((COUNT, 3)) < 0.5, rng.uniform(0.0, 2.0, (COUNT, 3)), 0.0)
    d = np.einsum("nij,nj->ni", C, forces)  # all gaps are closed, also where no force acts
    found = engine_forces(C, d)
    np.testing.assert_allclose(found, forces, atol=1e-9 * forces.max())
    symmetric = np.broadcast_to(np.eye(2) + 0.5, (3, 2, 2))
    overlaps = np.array([[0.0, 0.0], [1.0, 1.0], [1.5, 0.5]])  # the last: the second just touches
    found = engine_forces(symmetric, overlaps)
    np.testing.assert_allclose(found, [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]], atol=1e-15)


def test_brute_force_can_tell() -> None:
    """Contact forces that are computed one by one, without coupling, are not the solution."""
    C, d = random_groups(3, 7)
    alone = np.maximum(d / np.einsum("nii->ni", C), 0.0)
    assert np.abs(alone - brute_forces(C, d)).max() > 0.1


@pytest.mark.parametrize("system", ["two-mass", "three-contacts"])
def test_conditions_hold_at_every_instant(system: str) -> None:
    """Each row has forces >= 0 and no remaining overlap; friction is in its bounds."""
    run = rig(0.1, record=20e-6) if system == "two-mass" else heart(0.1, record=20e-6)
    result, model, par = simulate(run), run.model, run.par
    assert result.status == "done"
    x = np.stack([result[name] for name in model.State._fields], axis=1)
    contacts = ("F_wall",) if system == "two-mass" else ("f_1", "f_2", "f_12")
    F = np.stack([result[name] for name in contacts], axis=1)[2:]
    names = [n for n in result.names if n.startswith("friction_")]
    friction = np.stack([result[name] for name in names], axis=1)[2:]
    moving = [model.State._fields.index(name) for name in model.frictions]
    C = model.compliance(par)[0]
    predicted = x[1:-1] + 0.5 * np.diff(x, axis=0)[:-1]
    v_all = x[:, moving]
    kept = (np.sign(v_all[1:]) == np.sign(v_all[:-1])).all(axis=1)  # no turn, stop or release
    outside = 0
    for k, instant in enumerate(x[2:]):
        d, at_y = (
            np.array(model.gap(model.State(*at), model.State(*at), par)[0])
            for at in (instant, predicted[k])
        )
        left = np.array(C) @ F[k] - d
        assert F[k].min() > -1e-9
        assert left.min() > -1e-15
        assert np.abs(left * F[k]).max() < 1e-9 * 1e-6
        y, forces = model.State(*predicted[k]), solve_contacts(C, at_y)[1] @ at_y
        bounds = np.array(model.bounds(y, y, None, par, tuple(forces)))
        v = x[k + 2][moving]
        wanted = np.where(v > 0, bounds[:, 0], bounds[:, 1])
        error = np.abs(np.where(v == 0, np.clip(friction[k], *bounds.T), wanted) - friction[k])
        outside += int(kept[k] and kept[k + 1] and error.max() > 1e-7 * np.abs(bounds).max())
    # Bounds of a repeated substep are taken at another midpoint than the one predicted here; so are
    # those of a substep that is cut, and of the next.
    repeated = result.repeated - np.count_nonzero(~kept)
    assert outside <= max(repeated, 0)
    assert repeated <= 3
