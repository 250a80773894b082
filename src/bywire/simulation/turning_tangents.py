"""C text that keeps tangents right where a velocity with dry friction turns round.

At a reversal the friction turns round and the acceleration jumps from a- to a+. A neighboring
motion reverses at another time, and its velocity differs behind the reversal by a+/a- times what
it differed before (saltation). Steps give that in the mean only: a velocity slips through in one
substep (factor 1) or stands for one (factor 0). So the factor is put in, one substep later, when
both accelerations are known. Who rests for longer has forgotten what was before, in steps too.

Where the acceleration changes by a tenth from one substep to the next, steps are too long to tell
a-, and nothing is put in.
"""

from __future__ import annotations

from collections.abc import Sequence

TURNS = """typedef struct { int kind; double before, slope, earlier, tangent[L]; } turn;

// kind: 0 none, 1 slipped through in the last substep, 2 stood in it
static inline void mend(turn *w, double old, double now, const double *restrict was,
    double *restrict t) {
  const double slope = now - old;
  if (__builtin_expect(w->kind != 0, 0)) {
    const double ratio = now != 0.0 && slope * w->before > 0.0 ? slope / w->before : 0.0;
    const double factor = now == 0.0 ? 0.0 : (w->kind == 1 ? ratio - 1.0 : ratio);
    if (ratio < 2.0) for (int l = 0; l < L; ++l) t[l] += factor * w->tangent[l];
    w->kind = 0;
  }
  if (__builtin_expect(old != 0.0 && old * now <= 0.0, 0)
      && fabs(w->slope - w->earlier) < 0.1 * fabs(w->slope)) {
    w->kind = now != 0.0 ? 1 : 2;
    w->before = w->slope;
    memcpy(w->tangent, was, L * sizeof(double));
  }
  w->earlier = w->slope;
  w->slope = slope;
}
"""


def declare_turns(velocities: Sequence[int]) -> str:
    """Return the declarations ahead of the loops."""
    if not velocities:
        return ""
    return f"turn W[{len(velocities)}] = {{{{0}}}}; double was[{len(velocities)} * L];"


def watch_turns(velocities: Sequence[int]) -> list[str]:
    """Return what is kept of each velocity before a substep."""
    return [
        line
        for k, index in enumerate(velocities)
        for line in (
            f"const double old{k} = x{index};",
            f"memcpy(was + {k} * L, T + {index} * L, L * sizeof(double));",
        )
    ]


def mend_turns(velocities: Sequence[int]) -> list[str]:
    """Return what puts the factor in after a substep."""
    return [
        f"mend(W + {k}, old{k}, x{index}, was + {k} * L, T + {index} * L);"
        for k, index in enumerate(velocities)
    ]
