/* Types and functions for the C code of key figures, which translator.py generates. */
#include <stdint.h>

/* Samples over time. A slice refers to the same numbers. */
typedef struct {
  const double *at;
  int64_t n;
} bw_samples;

typedef struct {
  double at[2];
} bw_pair;

/* Reason why a figure is undefined: number of its text (0 if the figure is defined), and the numbers
 * in that text. */
typedef struct {
  int32_t reason;
  double numbers[3];
} bw_undefined;

/* A signal in several cases. The samples of a case are contiguous, and begin `between` numbers after
 * those of the previous case. `first` is null if the signal is not recorded. */
typedef struct {
  const double *first;
  int64_t between;
} bw_signal;

static inline bw_samples bw_case(const bw_signal *signal, int64_t k, int64_t n) {
  return (bw_samples){signal->first + k * signal->between, n};
}

/* Test the bits: kernels are compiled with flags that let compilers assume finite numbers. */
static inline int bw_is_finite(double x) {
  uint64_t bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  return (~bits & 0x7ff0000000000000u) != 0;
}

static inline double bw_no_number(void) {
  const uint64_t bits = 0x7ff8000000000000u;
  double x;
  __builtin_memcpy(&x, &bits, sizeof x);
  return x;
}

static inline int64_t bw_length(bw_samples y) { return y.n; }
static inline double bw_from_end(bw_samples y, int64_t back) { return y.at[y.n - back]; }
static inline double bw_larger(double a, double b) { return b > a ? b : a; }
static inline double bw_smaller(double a, double b) { return b < a ? b : a; }
static inline int64_t bw_larger_int(int64_t a, int64_t b) { return b > a ? b : a; }
static inline int64_t bw_smaller_int(int64_t a, int64_t b) { return b < a ? b : a; }

static inline int64_t bw_floor_divide(int64_t a, int64_t b) {
  return a / b - (a % b != 0 && (a < 0) != (b < 0));
}

static inline double bw_largest(bw_samples y) {
  double most = y.at[0];
  for (int64_t k = 1; k < y.n; ++k) most = y.at[k] > most ? y.at[k] : most;
  return most;
}

static inline double bw_least(bw_samples y) {
  double least = y.at[0];
  for (int64_t k = 1; k < y.n; ++k) least = y.at[k] < least ? y.at[k] : least;
  return least;
}

static inline int64_t bw_bisect_left(bw_samples y, double x) {
  int64_t low = 0, high = y.n;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (y.at[middle] < x) low = middle + 1;
    else high = middle;
  }
  return low;
}

static inline int64_t bw_bisect_right(bw_samples y, double x) {
  int64_t low = 0, high = y.n;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    if (x < y.at[middle]) high = middle;
    else low = middle + 1;
  }
  return low;
}

/* Return the bound of a slice as in Python, where negative numbers count from the end. */
static inline int64_t bw_clipped(int64_t k, int64_t n) {
  k = k < 0 ? k + n : k;
  return k < 0 ? 0 : k > n ? n : k;
}

static inline bw_samples bw_slice(bw_samples y, int64_t begin, int64_t end) {
  begin = bw_clipped(begin, y.n), end = bw_clipped(end, y.n);
  return (bw_samples){y.at + begin, end > begin ? end - begin : 0};
}

/* Return space for n numbers from the work array, which every case reuses from its beginning. */
static inline double *bw_take(double **room, int64_t n) {
  double *taken = *room;
  *room += n;
  return taken;
}

static inline bw_samples bw_zeros(double **room, int64_t n) {
  double *restrict made = bw_take(room, n);
  for (int64_t k = 0; k < n; ++k) made[k] = 0.0;
  return (bw_samples){made, n};
}

static inline bw_samples bw_copy(double **room, bw_samples y) {
  double *restrict made = bw_take(room, y.n);
  for (int64_t k = 0; k < y.n; ++k) made[k] = y.at[k];
  return (bw_samples){made, y.n};
}

/* Results: for each figure its values in all cases, and the reasons for undefined ones. */
typedef struct {
  double *values;
  int32_t *reasons;
  double *numbers;
  int64_t cases;
} bw_figures;

/* Store a figure of a case. `no_number`: reason for a value that is not finite. */
static inline void bw_give(const bw_figures *to, int64_t figure, int64_t k, double value,
    bw_undefined none, int32_t no_number) {
  const int64_t place = figure * to->cases + k;
  if (!none.reason && !bw_is_finite(value)) none.reason = no_number;
  to->values[place] = none.reason ? bw_no_number() : value;
  to->reasons[place] = none.reason;
  for (int64_t j = 0; j < 3; ++j) to->numbers[3 * place + j] = none.numbers[j];
}
