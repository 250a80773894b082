"""Families evaluate many cases at once exactly like single cases: values and reasons."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from bywire.bench.kpis import (
    effort,
    extremes,
    hysteresis,
    loop_family,
    occupation,
    release,
    static_gain,
    step_response,
    vehicle_stop,
)
from bywire.bench.kpis.families import FAMILIES, FamilyJudge, evaluate, evaluate_cases
from bywire.bench.kpis.loop_family import NO_NUMBER
from bywire.bench.kpis.samples import moving_average, smoothed
from bywire.bench.recording import Rows
from bywire.simulation.compiler import find_compiler

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")
CASES = 300
STEP = step_response.Setting("y", 0.0, 0.0, 1.0)
SETTINGS = {
    "step": ("step_response", STEP),
    "smoothed": ("step_response", replace(STEP, t_step=0.01, smoothing=0.03)),
    "open loop": ("step_response", replace(STEP, start=None, end=None)),
    "window": ("step_response", replace(STEP, window=(0.5, 0.7))),
    "no window": ("step_response", replace(STEP, end=None, window=(3.0, 4.0))),
    "effort": ("effort", effort.Setting("y", "power", "energy")),
    "power alone": ("effort", effort.Setting("y", "power", "nothing")),
    "occupation": ("occupation", occupation.Setting("mode", "t_stuck", "mode", "nothing")),
    "samples of the mode": ("occupation", occupation.Setting("mode", "", "y")),
    "extremes": ("extremes", extremes.Setting("y")),
    "release": ("release", release.Setting("y", 0.02)),
    "gain": ("static_gain", static_gain.Setting("y", 0.01, 0.35, "A", smoothing=0.03)),
}

DRAWN = {
    "effort": lambda random: (name if random.random() < 0.7 else "nothing" for name in "yyy"),
    "extremes": lambda _: ("y",),
    "release": lambda random: ("y", float(random.choice([0.0, 0.5, 1.0]))),
    "occupation": lambda random: ("mode", str(random.choice(["mode", "none"])), "y", "none"),
}
"""``DRAWN[family](random)``: arguments of its ``Setting`` for the signals y (unit m), mode"""
REASONS = {
    "step_response": 6,
    "vehicle_stop": 4,
    "effort": 2,
    "occupation": 2,
    "release": 2,
    "static_gain": 2,
}
"""least number of different reasons, if a family has any besides samples that are not numbers"""


@pytest.fixture(scope="module")
def rows() -> Rows:
    """Return responses that oscillate, creep, never settle, never start, or start at their end."""
    random = np.random.default_rng(1)
    t = np.linspace(-0.2, 1.0, 241)
    rate, swing, gain = (random.uniform(*ends, (CASES, 1)) for ends in ((1, 40), (0, 60), (0, 1.2)))
    y = (t >= 0) * gain * (1.0 - np.exp(-rate * np.clip(t, 0.0, None)) * np.cos(swing * t))
    y += random.choice([0.0, 0.001, 0.05], (CASES, 1)) * random.standard_normal(y.shape)
    y[::17] = 0.0
    y[::19] += 1.0
    mode = (random.uniform(size=y.shape) < 0.3).astype(float)
    mode[::23, 5] = 0.5
    power = y * random.standard_normal(y.shape)
    signals = {
        "y": y,
        "power": power,
        "mode": mode,
        "energy": np.cumsum(power, axis=1),
        "t_stuck": np.cumsum(mode, axis=1),
    }
    return Rows(t, signals, {name: {"units": "m"} for name in signals})


def test_each_case_is_as_if_it_were_alone_for_every_family(rows):
    told = set()
    tried = {family for family, _ in SETTINGS.values()} | {"vehicle_stop"}
    loops = {name for name, family in FAMILIES.all().items() if family.loops is not None}
    assert tried >= loops, f"add a setting of {loops - tried} to SETTINGS"
    for family, setting in SETTINGS.values():
        together = evaluate_cases(family, rows, [setting] * CASES)
        assert list(together) == list(FAMILIES.find(family).measures)
        for k in range(CASES):
            for name, alone in evaluate(family, rows.case(k), setting).items():
                assert together[name].case(k) == alone
                told |= {alone.note.split()[0]} if math.isnan(alone.value) else set()
    assert told >= {"never", "already", "enters", "the"}  # reasons of every kind


@needs_compiler
@pytest.mark.parametrize(
    "family",
    [name for name, family in FAMILIES.all().items() if family.loops is not None],
)
def test_c_gives_the_bits_and_texts_of_python_on_any_samples(family):
    random, loops = np.random.default_rng(5), FAMILIES.find(family).loops
    assert loops is not None
    assert loops.is_compiled
    every: set[str] = set()
    for _ in range(60):
        few, setting = _drawn(random, family)
        by_c = evaluate_cases(family, few, [setting] * 5)
        for k in range(5):
            each, level = loops.signals_of(few.case(k), setting)
            lists = {name: None if y is None else y.tolist() for name, y in each.items()}
            for name, value in loops.in_python(few["time"].values.tolist(), lists, setting).items():
                by_python = loops.kpi(loops.measures[name], value, setting, level)
                assert by_c[name].case(k) == by_python
                assert math.copysign(1.0, by_c[name].values[k]) == math.copysign(
                    1.0, by_python.value
                )
                every |= {by_python.note}
    assert NO_NUMBER not in every  # divisions are guarded
    told = {" ".join(note.split()[:2]) for note in every if note}
    assert len(told) >= REASONS.get(family, 1), f"the samples give too few reasons: {told}"


def test_a_step_is_judged_as_numpy_does():
    """An independent reference with arrays: crossings, the last entry, extremes."""
    random, defined = np.random.default_rng(9), 0
    for place in range(300):
        few, setting = _drawn(random, "step_response")
        setting = replace(setting, start=0.0, end=1.0, smoothing=0.0, window=None)
        t, y = few["time"].values, few["y"].values[place % 5]
        found = evaluate("step_response", few.case(place % 5), setting)
        after = t > setting.t_step
        s = np.append(setting.t_step, t[after])
        z = np.append(np.interp(setting.t_step, t, y), y[after])
        beyond = np.abs(z - 1.0) > 0.02
        expected = {
            "overshoot": 100.0 * max(0.0, z.max() - 1.0),
            "settling_time": _entry(s, z, int(np.flatnonzero(beyond)[-1])) if beyond.any() else 0.0,
            "dead_time": _crossing(s, z, 0.05),
            "rise_time": _crossing(s, z, 0.9) - _crossing(s, z, 0.1),
        }
        for name, value in expected.items():
            if not found[name].note:
                defined += 1
                assert found[name].value == pytest.approx(value, rel=1e-12, abs=1e-15), name
    assert defined > 100


def _crossing(t: np.ndarray, z: np.ndarray, level: float) -> float:
    k = int(np.argmax(z >= level))
    if k == 0:
        return math.nan
    return float(np.interp(level, z[k - 1 : k + 1], t[k - 1 : k + 1])) - float(t[0])


def _entry(t: np.ndarray, z: np.ndarray, k: int) -> float:
    if k == t.size - 1:
        return math.nan
    edge = 1.0 + math.copysign(0.02, z[k] - 1.0)
    return float(t[k] + (edge - z[k]) / (z[k + 1] - z[k]) * (t[k + 1] - t[k]) - t[0])


@pytest.mark.parametrize("period", [0.004, 0.03, 5.0])
def test_the_moving_average_of_loops_is_that_of_arrays(rows, period):
    t, y = rows["time"].values, rows["y"].values[3]
    np.testing.assert_array_equal(
        moving_average(t.tolist(), y.tolist(), period), smoothed(t, y, period)
    )


@pytest.mark.parametrize("is_long", [False, True])
def test_a_long_run_is_judged_alike(rows, is_long, monkeypatch):
    monkeypatch.setattr(loop_family, "_FEW", 0 if is_long else math.inf)
    found = evaluate("step_response", rows.case(2), STEP)
    together = evaluate_cases("step_response", rows, [STEP] * CASES)
    assert {name: each.case(2) for name, each in together.items()} == found


def test_without_a_compiler_each_case_is_judged_by_python(rows, monkeypatch):
    few = Rows(rows["time"].values, {"y": rows["y"].values[:3]}, {"y": {"units": "m"}})
    by_c = evaluate_cases("step_response", few, [STEP] * 3)
    monkeypatch.setattr(loop_family.LoopFamily, "is_compiled", False)
    by_python = evaluate_cases("step_response", few, [STEP] * 3)
    for name, each in by_python.items():
        assert [each.case(k) for k in range(3)] == [by_c[name].case(k) for k in range(3)]


def _drawn(random: np.random.Generator, family: str) -> tuple[Rows, object]:
    """Return a few coarse rows, equal to levels and to each other in places, with their views."""
    n = int(random.integers(2, 40))
    t = np.cumsum(random.choice([0.01, 0.02, 0.05], n)) - 0.1
    y = np.round(random.choice([0.0, 1.0, 3.0]) * random.standard_normal((5, n)), 1)
    y[0], y[1, n // 2 :] = 0.5, 1.0
    if random.random() < 0.1:
        y[2, -1] = random.choice([math.nan, math.inf])
    if family == "vehicle_stop":
        return _drawn_stop(random, t, y)
    mode = (random.uniform(size=y.shape) < 0.5).astype(float)
    mode[4, 0] += random.choice([0.0, 0.5])
    rows = Rows(t, {"y": y, "mode": mode}, {"y": {"units": "m"}, "mode": {"units": "1"}})
    if family not in ("step_response", "static_gain"):
        assert family in DRAWN, f"add the arguments of {family}.Setting to DRAWN"
        return rows, FAMILIES.find(family).setting_class(*DRAWN[family](random))
    levels = random.choice([None, 0.0, 1.0], 2, p=[0.2, 0.4, 0.4])
    window = sorted(random.uniform(t[0], t[-1], 2)) if random.random() < 0.3 else None
    at = float(random.choice([*t[:-1], random.uniform(t[0], t[-1])]))
    seen = {
        "window": window and tuple(map(float, window)),
        "smoothing": float(random.choice([0.0, 0.03, 0.5])),
    }
    if family == "static_gain":
        return rows, static_gain.Setting("y", at, float(random.choice([0.0, 0.35])), "A", **seen)
    return rows, step_response.Setting("y", at, *levels, **seen)


def _drawn_stop(random: np.random.Generator, t: np.ndarray, y: np.ndarray) -> tuple[Rows, object]:
    """Return speeds that fall to zero, jump below it or never reach it, locked wheels, and heat.

    ``y``: the speeds, or damaged samples.
    """
    v = random.choice([5.0, 20.0]) * np.linspace(1.0, random.choice([-0.5, 0.0, 0.2]), t.size) + y
    names = vehicle_stop.Setting()
    other = {
        name: np.round(random.standard_normal(y.shape), 1)
        for field, name in vars(names).items()
        if field not in {"ideal", "peak_slip", "v"}
    }
    for wheel in ("f", "r"):
        other[f"omega_{wheel}"] *= random.uniform(size=y.shape) < 0.3
        other[f"E_brake_{wheel}"] = np.cumsum(np.abs(other[f"E_brake_{wheel}"]), axis=1)
        other[f"E_brake_{wheel}"][3] = 0.0
    other["x"] = np.cumsum(np.maximum(v, 0.0), axis=1) * random.choice([0.0, 0.02], p=[0.1, 0.9])
    time = 10.0 * t if random.random() < 0.5 else t
    rows = Rows(time, {"v": v, **other}, {name: {"units": "1"} for name in ("v", *other)})
    ideal = float(random.choice([math.inf, 1.0]))
    return rows, replace(names, ideal=ideal, peak_slip=float(random.choice([0.0, 0.1])))


def test_levels_may_differ_between_cases(rows):
    ends = np.linspace(0.5, 1.5, CASES).tolist()
    settings = [replace(STEP, end=end, start=0.1 * end) for end in ends]
    together = evaluate_cases("step_response", rows, settings)
    emptied = evaluate_cases("release", rows, [release.Setting("y", end) for end in ends])
    steps = [static_gain.Setting("y", 0.0, end, "A") for end in ends]
    gains = evaluate_cases("static_gain", rows, steps)["static_gain"]
    for k in range(0, CASES, 7):
        for name, alone in evaluate("step_response", rows.case(k), settings[k]).items():
            assert together[name].case(k) == alone
        alone = evaluate("static_gain", rows.case(k), steps[k])["static_gain"]
        assert (gains.case(k), alone.unit) == (alone, "m/A")
        one = evaluate("release", rows.case(k), release.Setting("y", ends[k]))
        assert emptied["time_to_empty"].case(k) == one["time_to_empty"]


def test_what_differs_otherwise_or_is_broken_is_judged_one_by_one(rows):
    few = Rows(rows["time"].values, {"y": rows["y"].values[1:4].copy()}, {"y": {"units": "m"}})
    smoothed = [replace(STEP, smoothing=each) for each in (0.0, 0.02, 0.03)]
    with_end = [STEP, replace(STEP, end=None), STEP]
    few["y"].values[1, 7] = math.nan
    for settings in (smoothed, with_end, [STEP] * 3):
        together = evaluate_cases("step_response", few, settings)
        for k, setting in enumerate(settings):
            alone = evaluate("step_response", few.case(k), setting)
            assert {n: figure.case(k) for n, figure in together.items()} == alone
    loops = [hysteresis.Setting("y", "y")] * 3  # a family that evaluates cases one by one
    loop = evaluate_cases("hysteresis", few, loops)["loop_area"]
    assert loop.case(2) == evaluate("hysteresis", few.case(2), loops[2])["loop_area"]
    assert "not a number" in together["rise_time"].case(1).note
    assert not together["overshoot"].case(2).note


def test_a_judge_by_families_is_one_of_a_recording_too(rows):
    judge = FamilyJudge(
        lambda end: {"step_response": replace(STEP, end=end), "effort": effort.Setting("y")},
        left_out={"energy"},
    )
    assert judge.signals([1.0, 1.1]) >= {"y", "P_el", "E_source"}
    together = judge.of_cases(rows, [1.0] * CASES)
    recording = xr.Dataset(
        {"y": ("time", rows["y"].values[3], {"units": "m"})}, {"time": rows["time"].values}
    )
    assert [kpi.name for kpi in together] == [kpi.name for kpi in judge({"run": recording}, 1.0)]
    assert [each.case(3) for each in together] == list(judge({"run": recording}, 1.0))
