/* String functions for the kernel, which has no C library here. */
#include <stddef.h>
#define memcpy __builtin_memcpy
#define memset __builtin_memset
