"""Noise of stimuli: the samples of NumPy's seed sequences."""

import numpy as np
import pytest

from bywire.bench.experiment import put_noise

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
