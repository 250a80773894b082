/* A driver's library, libcuda.so.1, that NVIDIA's bindings load and call: its memory is this
 * machine's, and its kernels the libraries in the folder EMULATED_KERNELS, by their names. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROOM = 1 << 30, INVALID_VALUE = 1, INVALID_IMAGE = 200, INVALID_CONTEXT = 201,
  NOT_FOUND = 500 };
static void *const context = (void *)0x1234;

static int fake_cuInit(unsigned flags) { return flags ? INVALID_VALUE : 0; }
static int fake_cuDeviceGetCount(int *count) { *count = 1; return 0; }
static int fake_cuDeviceGet(int *device, int number) { *device = number; return 0; }
static int fake_cuDeviceGetName(char *name, int length, int device) {
  strncpy(name, "emulated below the bindings", (size_t)length);
  return device;
}
static int fake_cuDeviceGetAttribute(int *value, int kind, int device) {
  *value = kind == 75 ? 9 : 0; /* compute capability 9.0 */
  return device;
}
static int fake_cuDevicePrimaryCtxRetain(void **given, int device) {
  *given = context;
  return device;
}
static int fake_cuDriverGetVersion(int *version) { *version = 12090; return 0; }
static int fake_cuDevicePrimaryCtxSetFlags(int device, unsigned flags) {
  return flags == 4 ? device : INVALID_VALUE;
}
static int fake_cuMemHostAlloc(void **place, size_t size, unsigned flags) {
  *place = malloc(size);
  return flags ? INVALID_VALUE : 0;
}
static int fake_cuMemFreeHost(void *place) { free(place); return 0; }
static int fake_cuCtxSetCurrent(void *given) { return given == context ? 0 : INVALID_CONTEXT; }
static int fake_cuCtxSynchronize(void) { return 0; }
static int fake_cuMemGetInfo(size_t *free, size_t *total) { *free = *total = ROOM; return 0; }
static int fake_cuMemAlloc(uint64_t *place, size_t size) {
  *place = (uint64_t)malloc(size);
  return 0;
}
static int fake_cuMemFree(uint64_t place) { free((void *)place); return 0; }
static int fake_cuMemcpyHtoD(uint64_t place, const void *array, size_t size) {
  memcpy((void *)place, array, size);
  return 0;
}
static int fake_cuMemcpyDtoH(void *array, uint64_t place, size_t size) {
  memcpy(array, (void *)place, size);
  return 0;
}
/* CUDA_MEMCPY2D: source and destination, each x, y, kind, host, device, array, pitch. */
struct place { size_t x, y; int kind; char *host; uint64_t device; void *array; size_t pitch; };
struct lines { struct place from, to; size_t size, count; };
static int fake_cuMemcpy2D(const struct lines *copied) {
  const struct place *from = &copied->from, *to = &copied->to;
  if (from->kind != 2 || to->kind != 1 || from->x || from->y || to->x || to->y)
    return INVALID_VALUE;
  for (size_t k = 0; k < copied->count; ++k)
    memcpy(to->host + k * to->pitch, (char *)from->device + k * from->pitch, copied->size);
  return 0;
}
static int fake_cuModuleLoadData(void **module, const void *image) {
  if (memcmp(image, "\177ELF", 4)) return INVALID_IMAGE;
  *module = context;
  return 0;
}
static int fake_cuModuleGetFunction(void **function, void *module, const char *name) {
  char path[4096];
  snprintf(path, sizeof(path), "%s/%s", getenv("EMULATED_KERNELS"), name);
  void *const library = module == context ? dlopen(path, RTLD_NOW) : NULL;
  *function = library ? dlsym(library, "emulated") : NULL;
  return *function ? 0 : NOT_FOUND;
}
static int fake_cuLaunchKernel(void *function, unsigned blocks, unsigned by, unsigned bz,
    unsigned threads, unsigned ty, unsigned tz, unsigned shared, void *stream, void **arguments,
    void **extra) {
  if (by != 1 || bz != 1 || ty != 1 || tz != 1 || shared || stream || extra) return INVALID_VALUE;
  ((void (*)(unsigned, unsigned, void **))function)(blocks, threads, arguments);
  return 0;
}

int cuGetProcAddress_v2(const char *asked, void **found, int version, uint64_t flags, int *status) {
  *found = NULL;
#define HAS(name) if (!strcmp(asked, #name)) *found = (void *)fake_##name;
  HAS(cuInit) HAS(cuDeviceGetCount) HAS(cuDeviceGet) HAS(cuDeviceGetName)
  HAS(cuDeviceGetAttribute) HAS(cuDevicePrimaryCtxRetain) HAS(cuCtxSetCurrent)
  HAS(cuCtxSynchronize) HAS(cuMemGetInfo) HAS(cuMemAlloc) HAS(cuMemFree) HAS(cuMemcpyHtoD)
  HAS(cuMemcpyDtoH) HAS(cuMemcpy2D) HAS(cuMemHostAlloc) HAS(cuMemFreeHost) HAS(cuDriverGetVersion)
  HAS(cuDevicePrimaryCtxSetFlags) HAS(cuModuleLoadData) HAS(cuModuleGetFunction) HAS(cuLaunchKernel)
  if (status) *status = *found == NULL;
  (void)version;
  (void)flags;
  return *found ? 0 : NOT_FOUND;
}
