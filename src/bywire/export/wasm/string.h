/* Functions of a C library for the kernel, where there is none. */
#include <stddef.h>
#define memcpy __builtin_memcpy
#define memset __builtin_memset
