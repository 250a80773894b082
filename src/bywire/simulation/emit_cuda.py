"""Kernel of many cases on a graphics processor: a thread each, with the statements of a run.

Every number of a case stands beside the same number of the next case, so that threads that run
together read and write neighbors; rows stand as who asks for them has them. A thread has branches
and cuts of its own, as a single run has.
"""

from __future__ import annotations

from bywire.simulation.c_runtime import ONE_LANE
from bywire.simulation.emit_single import Caller, emit_single
from bywire.simulation.stages import Stages

ENTRY = "bw_run_cases"
"""name of its function"""
THREADS = 64
"""threads of a block, which share a processor's registers, of which each takes as many as it may"""

# Behind `emission.PLAN`: how many cases, whether each has a stimulus of its own, which row of the
# stimulus is the first in memory, and the distances between the entries of two cases, rows and
# signals.
_BEGIN = """const int64_t cases = plan[8 + {tasks}], own = plan[9 + {tasks}];
  const int64_t ahead = plan[10 + {tasks}], by_case = plan[11 + {tasks}];
  const int64_t by_row = plan[12 + {tasks}], by_signal = plan[13 + {tasks}];
  const int64_t at = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  if (at >= cases) return;
  const int64_t wide = own ? cases : 1;
  if (own) u += at;
  state += at;
  rec += at * by_case;
  double p[{np} + 1];
  for (int k = 0; k < {np}; ++k) p[k] = par[k * cases + at];
  (void)wide; (void)chosen;"""

_THREADS = Caller(
    runtime=ONE_LANE,
    head=f"""KERNEL void __launch_bounds__({THREADS}) {ENTRY}(const double *restrict par, double h,
    const double *restrict u, double *restrict state, const int64_t *restrict plan,
    double *restrict rec)""",
    begin=_BEGIN,
    stimulus="uk[{k} * wide]",
    entry="state[{k} * cases]",
    row="u + (f / stim - ahead) * {nu} * wide",
    record="""double *row = rec + (f / every - row0) * by_row;
      for (int j = 0; j < {count}; ++j) row[j * by_signal] = o[j];""",
)


def emit_cuda(stages: Stages) -> str:
    """Return the CUDA C of the kernel; before it stands what its compiler is to know first.

    That is ``c_runtime.CUDA`` for NVRTC.
    """
    return emit_single(stages, _THREADS)
