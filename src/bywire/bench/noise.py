"""Noise of stimuli: standard normal samples that a seed draws, a generator for each signal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

_WORD = 32  # bits
_POOL = 4  # words of a seed, at least, before what tells its children apart


def put_noise(samples: NDArray[np.float64], seed: Sequence[int], child: int) -> None:
    """Fill samples with standard normal noise, shape (samples,).

    They are those of ``SeedSequence(seed, spawn_key=(child,))``, which takes a third of the time
    where it is given its words.

    Parameters
    ----------
    seed
        Integers >= 0.
    child
        Which of the generators of this seed, >= 0.
    """
    words = [word for number in seed for word in _words(number)]
    words += [0] * (_POOL - len(words))
    sequence = np.random.SeedSequence(np.array([*words, *_words(child)], dtype=np.uint32))
    generator = np.random.Generator(np.random.PCG64(sequence))
    if samples.flags.c_contiguous:
        generator.standard_normal(out=samples)
    else:
        samples[:] = generator.standard_normal(samples.size)


def _words(number: int) -> Iterator[int]:
    """Yield the words of an integer, the lowest first; one of zero."""
    yield number & 0xFFFFFFFF
    while number := number >> _WORD:
        yield number & 0xFFFFFFFF
