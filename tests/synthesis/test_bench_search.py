"""The search on the bench measures no candidate further that it would not take up anyway."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import pytest

from bywire.synthesis import verification
from bywire.synthesis.bench_figures import BenchFigures, Small
from bywire.synthesis.designer import Problem
from bywire.synthesis.linear_case import NOMINAL, read
from bywire.synthesis.verification import Promising, Tuning, bench_slacks, ceiling, tune

REQUIRED = read(
    ["bandwidth >= 10 Hz", "phase margin >= 60 deg", "overshoot <= 15 %", "disk margin >= 0.5"]
)
BANDWIDTH, PHASE, OVERSHOOT, DISK = map(str, REQUIRED)
_CROSSED = 5.0


def of_gains(k: float, d: float) -> tuple[float, float, float, float]:
    """Return gain at the target, describing phase margin, overshoot, linear phase margin."""
    return 0.35 * k * (1.0 + 0.2 * d), 75.0 - 14.0 * k + 9.0 * d, 9.0 * k - 4.0 * d, 70.0 - 8.0 * d


def seen(k: float, d: float, stage: int) -> BenchFigures:
    gain, phase, overshoot, _ = of_gains(k, d)
    step = {"overshoot": overshoot, "settling_time": 0.1, "steady_state_error": 0.0}
    looks = (
        (),
        (Small(1e5, math.nan, gain, math.nan, math.nan, math.nan, True),),
        (Small(1e5, 10.0 * gain, min(gain, 0.9), phase, _CROSSED, 1.0, True),),
    )
    return BenchFigures(looks[stage], step)


def linear(problem: Problem, gains: Mapping[str, float]) -> dict[str, float]:
    room = (of_gains(gains["k"], gains["d"])[3] - 60.0) / 60.0
    return {BANDWIDTH: 1.0, PHASE: room, OVERSHOOT: 1.0, DISK: 0.8 - 0.3 * gains["d"]}


def searched(monkeypatch: pytest.MonkeyPatch, asked: bool) -> tuple[Tuning, list[int]]:
    """Return a search, and how many candidates passed each stage."""
    monkeypatch.setattr(verification, "linear_slacks", linear)
    stages = [0, 0, 0]

    def measure(
        gains: Mapping[str, Sequence[float]], worth: Promising
    ) -> list[Mapping[str, BenchFigures] | None]:
        rows: list[Mapping[str, BenchFigures] | None] = []
        for j, (k, d) in enumerate(zip(*gains.values(), strict=True)):
            for stage in range(3):
                stages[stage] += 1
                if asked and stage < 2 and not worth(j, [seen(k, d, stage)]):
                    rows.append(None)
                    break
            else:
                rows.append({NOMINAL: seen(k, d, 2)})
        return rows

    problem = Problem({"k": (0.3, 4.0), "d": (0.1, 3.0)}, REQUIRED, ())
    return tune(problem, {"k": 1.0, "d": 0.3}, measure, generations=12), stages


def test_what_is_left_changes_no_step_of_the_search(monkeypatch):
    monkeypatch.setattr(verification, "ceiling", lambda *_: math.inf)
    full, all_stages = searched(monkeypatch, asked=False)
    monkeypatch.undo()
    fewer, stages = searched(monkeypatch, asked=True)
    assert fewer.best == full.best
    assert fewer.count == full.count == 13 * 36
    assert len(fewer.tried) == fewer.count - fewer.untold < len(full.tried)
    # The linear models, the step and the first sines leave some each.
    assert all_stages[0] > stages[0] > stages[1] > stages[2]
    # Near the best so far nothing is left out: the edge that is shown is that of all.
    least = full.best.slack - 0.03
    near = [each.gains for each in full.tried if each.slack >= least]
    assert len(near) > 36
    assert all(gains in [each.gains for each in fewer.tried] for gains in near)


def test_no_slack_exceeds_what_is_known_before():
    for k, d in ((0.5, 0.5), (1.5, 0.2), (2.5, 2.0), (3.5, 0.1)):
        gains = linear(None, {"k": k, "d": d})  # type: ignore[arg-type]
        final = min(bench_slacks(REQUIRED, seen(k, d, 2), gains).values())
        bounds = [ceiling(REQUIRED, [], gains)]
        bounds += [ceiling(REQUIRED, [seen(k, d, stage)], gains) for stage in range(3)]
        assert bounds == sorted(bounds, reverse=True)
        assert bounds[-1] == pytest.approx(final)
