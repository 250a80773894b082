/* Math functions for the kernel, which has no C library here: single instructions of WebAssembly,
 * and the page's functions for arguments outside the range of the kernel's own functions. */
#define IN_PAGE(name) __attribute__((import_module("math"), import_name(#name))) double name
#define HUGE_VAL __builtin_huge_val()
#define sqrt __builtin_sqrt
#define fabs __builtin_fabs
#define floor __builtin_floor
#define ceil __builtin_ceil
#define copysign __builtin_copysign
static inline double fmax(double a, double b) { return a > b ? a : b; }
static inline double fmin(double a, double b) { return a < b ? a : b; }
IN_PAGE(sin)(double);
IN_PAGE(cos)(double);
IN_PAGE(tan)(double);
IN_PAGE(atan)(double);
IN_PAGE(tanh)(double);
IN_PAGE(exp)(double);
IN_PAGE(log)(double);
IN_PAGE(pow)(double, double);
