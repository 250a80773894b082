/* What the kernel takes from a C library, where there is none. */
#include <stddef.h>
#define memcpy __builtin_memcpy
#define memset __builtin_memset
