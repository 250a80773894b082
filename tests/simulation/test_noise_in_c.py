"""Noise of stimuli: the samples of NumPy's seed sequences, for one run and for many in C."""

import numpy as np
import pytest

from bywire.simulation import noise
from bywire.simulation.noise import put_noise, put_noises

LONG = (2**70 + 3, 2**32, 0, 9)  # more words than a pool has


@pytest.mark.parametrize("seed", [(0,), (7, 1), (2**32 - 1, 5), LONG])
@pytest.mark.parametrize("child", [0, 3, 2**33])
def test_noise_is_that_of_a_child_of_the_seed(seed: tuple[int, ...], child: int) -> None:
    sequence = np.random.SeedSequence(seed, spawn_key=(child,))
    expected = np.random.default_rng(sequence).standard_normal(50)
    row, rows = np.empty(50), np.zeros((50, 3))
    put_noise(row, seed, child)
    put_noise(rows[:, 1], seed, child)  # in two parts
    assert np.array_equal(row, expected)
    assert np.array_equal(rows, np.column_stack((0 * expected, expected, 0 * expected)))


SEEDS = [[0, 0], [1, 3], [2**32, 1], [2**63 - 1, 0], [2**63 + 2**32, 2**40], [6, 7], [8, 9]]


@pytest.mark.parametrize("is_compiled", [True, False])
def test_noise_of_many_runs_is_that_of_each(
    is_compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_compiled:
        monkeypatch.setattr(noise, "_kernel", lambda: None)
    rows = np.zeros((3000, 4, len(SEEDS))).transpose(2, 0, 1)  # lanes last, as kernels read them
    put_noises(rows, np.array(SEEDS, dtype=np.uint64), (3, 1))
    expected, column = np.zeros(rows.shape), np.empty(3000)
    for run, seed in zip(expected, SEEDS, strict=True):
        for child, place in enumerate((3, 1)):
            put_noise(column, seed, child)
            run[:, place] = column
    assert np.array_equal(rows.view(np.int64), expected.view(np.int64))  # including signed zeros


def test_another_method_of_numpy_is_not_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = noise._kernel()
    if kernel is None:
        pytest.skip("needs a C compiler and NumPy's function")
    assert kernel.equals_numpy()
    monkeypatch.setattr(noise, "put_noise", lambda samples, *_: samples.fill(0.5))
    assert not kernel.equals_numpy()
