"""Standard normal noise of many runs, in C: the samples of NumPy's generators, bit for bit.

NumPy takes about 12 ns per sample, because its branch on the sign is wrong half of the time. The C
code here takes 2.5 ns: it advances the generators of four signals alternately, sets the sign
without a branch, and calls NumPy's function only for the 0.7 % of samples that need more than one
random number. It measures the tables of NumPy's method with this function and compares its first
samples with NumPy's, so that another method in a future NumPy cannot change the noise.

References
----------
G. Marsaglia and W. W. Tsang, The Ziggurat Method for Generating Random Variables, Journal of
Statistical Software 5, 2000. M. E. O'Neill, PCG: A Family of Simple Fast Space-Efficient
Statistically Good Algorithms for Random Number Generation, Harvey Mudd College, 2014.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError
from bywire.core.typing import Array
from bywire.simulation.compiler import find_compiler, load_library
from bywire.simulation.native import pointer

_WORD = 32  # bits
_POOL = 4  # minimum number of words of a seed before those of its child


@dataclass(frozen=True)
class Noise:
    """Signals of a stimulus that are standard normal noise, each with its own generator.

    Parameters
    ----------
    seed
        Integers >= 0 and < 2**64.
    columns
        Columns of the noisy signals in a stimulus row.
    """

    seed: tuple[int, ...]
    columns: tuple[int, ...]


def put_noise(samples: Array, seed: Sequence[int], child: int) -> None:
    """Fill samples with standard normal noise, shape (samples,).

    The samples equal those of ``SeedSequence(seed, spawn_key=(child,))``. Passing the seed's words
    directly takes a third of the time.

    Parameters
    ----------
    seed
        Integers >= 0.
    child
        Number of the generator among those of this seed, >= 0.
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
    """Yield the 32-bit words of an integer, lowest first; one word for zero."""
    yield number & 0xFFFFFFFF
    while number := number >> _WORD:
        yield number & 0xFFFFFFFF


def put_noises(rows: Array, seeds: NDArray[np.uint64], columns: Sequence[int]) -> None:
    """Write the noise of several runs into their stimulus rows, equal to `put_noise` for each.

    Parameters
    ----------
    rows
        Shape (runs, samples, signals), with any strides.
    seeds
        Seed of each run, shape (runs, numbers).
    columns
        Columns of the noisy signals. The place of a column in this list is the number of its
        generator.
    """
    kernel = _kernel() if seeds.shape[1] <= _MOST else None
    if kernel is not None:
        kernel.put(rows, seeds, columns)
        return
    for run, seed in zip(rows, seeds.tolist(), strict=True):
        for child, column in enumerate(columns):
            put_noise(run[:, column], seed, child)


# --- In C

_C = r"""
#include <stdint.h>
#include <string.h>
typedef unsigned __int128 wide;
typedef struct {  /* numpy/random/bitgen.h */
  void *state;
  uint64_t (*next_uint64)(void *);
  uint32_t (*next_uint32)(void *);
  double (*next_double)(void *);
  uint64_t (*next_raw)(void *);
} bitgen;
typedef double (*draw)(bitgen *);  /* NumPy's random_standard_normal */
typedef struct { wide state, increment; } generator;

static inline void step(generator *g) {
  const wide factor = ((wide)2549297995355413924ULL << 64) + 4865540595714422341ULL;
  g->state = g->state * factor + g->increment;
}

static inline uint64_t next(generator *g) {
  step(g);
  const uint64_t x = (uint64_t)(g->state >> 64) ^ (uint64_t)g->state;
  const int turn = (int)(g->state >> 122);
  return x >> turn | x << (-turn & 63);
}

static uint64_t next_uint64(void *g) { return next(g); }
static double next_double(void *g) { return (double)(next(g) >> 11) * (1.0 / 9007199254740992.0); }

/* SeedSequence */
static inline uint32_t hashed(uint32_t value, uint32_t *constant, uint32_t factor) {
  value ^= *constant;
  *constant *= factor;
  value *= *constant;
  return value ^ value >> 16;
}

static inline uint32_t mixed(uint32_t x, uint32_t y) {
  const uint32_t z = 0xca01f9ddu * x - 0x4973f715u * y;
  return z ^ z >> 16;
}

static generator seeded(const uint64_t *seed, int64_t numbers, uint64_t child) {
  const uint32_t factor = 0x931e8875u;
  uint32_t words[2 * MOST + 2] = {0}, pool[4], constant = 0x43b0d7e5u;
  int count = 0;
  for (int64_t j = 0; j <= numbers; ++j) {
    const uint64_t number = j < numbers ? seed[j] : child;
    if (j == numbers && count < 4) count = 4;
    words[count++] = (uint32_t)number;
    if (number >> 32) words[count++] = (uint32_t)(number >> 32);
  }
  for (int j = 0; j < 4; ++j) pool[j] = hashed(words[j], &constant, factor);
  for (int from = 0; from < 4; ++from)
    for (int to = 0; to < 4; ++to)
      if (from != to) pool[to] = mixed(pool[to], hashed(pool[from], &constant, factor));
  for (int from = 4; from < count; ++from)
    for (int to = 0; to < 4; ++to)
      pool[to] = mixed(pool[to], hashed(words[from], &constant, factor));
  uint64_t part[4];
  constant = 0x8b51f9ddu;
  for (int j = 0; j < 4; ++j) {
    const uint64_t low = hashed(pool[2 * j & 3], &constant, 0x58f38dedu);
    part[j] = low | (uint64_t)hashed(pool[(2 * j + 1) & 3], &constant, 0x58f38dedu) << 32;
  }
  generator g = {0, ((wide)part[2] << 64 | part[3]) << 1 | 1};
  step(&g);
  g.state += (wide)part[0] << 64 | part[1];
  step(&g);
  return g;
}

/* A generator whose first number is known, and that counts the numbers that are read. */
typedef struct { uint64_t first; int count; } probe;
static uint64_t probe_uint64(void *p) {
  probe *at = p;
  return at->count++ ? at->count * 0x9e3779b97f4a7c15ULL : at->first;
}
static double probe_double(void *p) {
  return (double)(probe_uint64(p) >> 11) * (1.0 / 9007199254740992.0);
}

static double drawn(draw normal, uint64_t layer, uint64_t magnitude, int *count) {
  probe p = {layer | magnitude << 9, 0};
  bitgen g = {&p, probe_uint64, 0, probe_double, probe_uint64};
  const double x = normal(&g);
  *count = p.count;
  return x;
}

/* Width of each layer per unit of magnitude, and the magnitude from which one number is not
 * enough. */
void bw_layers(draw normal, double *width, uint64_t *least) {
  int count;
  for (int j = 0; j < 256; ++j) {
    width[j] = drawn(normal, j, 1, &count);
    uint64_t low = 0, high = 1ULL << 52;
    while (low < high) {
      const uint64_t middle = low + (high - low) / 2;
      drawn(normal, j, middle, &count);
      if (count == 1) low = middle + 1; else high = middle;
    }
    least[j] = low;
  }
}

#define TURNS 4
void bw_noise(draw normal, const double *width, const uint64_t *least, int64_t signals,
              int64_t samples, const uint64_t *seeds, int64_t numbers, const int64_t *children,
              const int64_t *places, int64_t stride, double *rows) {
  for (int64_t begin = 0; begin < signals; begin += TURNS) {
    generator g[TURNS];
    double *to[TURNS];
    for (int j = 0; j < TURNS; ++j) {  /* idle turns repeat the last signal */
      const int64_t k = begin + j < signals ? begin + j : signals - 1;
      g[j] = seeded(seeds + numbers * k, numbers, (uint64_t)children[k]);
      to[j] = rows + places[k];
    }
    for (int64_t t = 0; t < samples; ++t) {
#pragma GCC unroll 4
      for (int j = 0; j < TURNS; ++j) {
        const wide before = g[j].state;
        const uint64_t r = next(&g[j]), magnitude = r >> 9 & 0xfffffffffffffULL;
        double x = (double)(int64_t)magnitude * width[r & 0xff];
        uint64_t bits;
        memcpy(&bits, &x, sizeof x);
        bits ^= (r >> 8 & 1) << 63;
        memcpy(&x, &bits, sizeof x);
        if (__builtin_expect(magnitude >= least[r & 0xff], 0)) {
          bitgen own = {&g[j], next_uint64, 0, next_double, next_uint64};
          g[j].state = before;
          x = normal(&own);
        }
        to[j][t * stride] = x;
      }
    }
  }
}
"""
_MOST = 8  # numbers of a seed
_FLAGS = ("-O2", "-march=native")
_COMPARED = (64, 512)  # seeds and samples


class NoiseKernel:
    """Compiled function that writes the noise of many signals.

    Raises
    ------
    CompilerError
        When the C code cannot be compiled.
    """

    ENTRY = "bw_noise"
    """name of the function in the library"""

    def __init__(self, normal: ctypes.c_void_p, library: Any) -> None:
        self._normal, self._put = normal, library[self.ENTRY]
        self._put.restype = None
        self._width, self._least = np.empty(256), np.empty(256, dtype=np.uint64)
        library.bw_layers(normal, pointer(self._width), pointer(self._least))

    def put(self, rows: Array, seeds: NDArray[np.uint64], columns: Sequence[int]) -> None:
        """Write noise into stimulus rows; see `put_noises`."""
        runs, samples, _ = rows.shape
        by_run, by_sample, by_column = (stride // rows.itemsize for stride in rows.strides)
        places = np.add.outer(np.array(columns) * by_column, np.arange(runs) * by_run)
        children = np.repeat(np.arange(len(columns)), runs)
        every = np.tile(seeds, (len(columns), 1))
        self._put(
            self._normal,
            pointer(self._width),
            pointer(self._least),
            ctypes.c_int64(children.size),
            ctypes.c_int64(samples),
            pointer(every),
            ctypes.c_int64(seeds.shape[1]),
            pointer(children),
            pointer(places),
            ctypes.c_int64(by_sample),
            ctypes.c_void_p(rows.ctypes.data),
        )

    def equals_numpy(self) -> bool:
        """Return whether the first samples for some seeds equal those of NumPy."""
        seeds, samples = _COMPARED
        rows = np.empty((seeds, samples, 1))
        numbers = np.arange(seeds, dtype=np.uint64) * np.uint64(3**22)  # of one and two words
        self.put(rows, np.column_stack((numbers, numbers % np.uint64(5))), [0])
        numpys = np.empty(samples)
        for seed, own in zip(numbers.tolist(), rows[:, :, 0], strict=True):
            put_noise(numpys, (seed, seed % 5), 0)
            if not np.array_equal(own.view(np.int64), numpys.view(np.int64)):
                return False
        return True


@cache
def _kernel() -> NoiseKernel | None:
    """Return the compiled function; None without a compiler, or if NumPy has another method."""
    compiler = find_compiler()
    if compiler is None:
        return None
    try:
        # Documented for callers from C, but a build of NumPy may hide it.
        library = ctypes.CDLL(np.random._generator.__file__)
        normal = ctypes.cast(library.random_standard_normal, ctypes.c_void_p)
        text = _C.replace("MOST", str(_MOST))
        made = NoiseKernel(normal, load_library(text, _FLAGS, compiler, NoiseKernel.ENTRY)[0])
    except (AttributeError, OSError, CompilerError):
        return None
    return made if made.equals_numpy() else None
