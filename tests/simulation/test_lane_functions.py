"""Inline functions of lane kernels versus libm, for all vector widths."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.simulation import case_kernels, ensemble
from bywire.simulation.c_runtime import LANES
from bywire.simulation.compiler import VECTOR, compile_library, find_compiler
from bywire.simulation.native import pointer
from bywire.simulation.run import simulate
from systems.three_contacts import heart

Array = NDArray[np.float64]
EPS = np.finfo(float).eps
WIDTHS = {"native": (), "at most 4": ("-mno-avx512f",), "2": ("-mno-avx512f", "-mno-avx")}
FUNCTIONS = {
    "EXP": "EXP(a)",
    "SIN": "SIN(a)",
    "COS": "COS(a)",
    "LOG": "LOG(a)",
    "SQRT": "SQRT(a)",
    "FLOOR": "FLOOR(a)",
    "FABS": "FABS(a)",
    "INVERSE": "INVERSE(a)",
    "MAX": "MAX(a, SET(0.3))",
    "MIN": "MIN(a, SET(0.3))",
    "SELECT": "SELECT(LT(a, SET(0.3)), a, SET(2.0))",
    "TAN": "TAN(a)",
    "POW": "POW(a, SET(1.7))",
    "EXP_WHERE": "EXP_WHERE(LE(a, SET(1.0)), a)",
    "EXP_DECAYED": "EXP_DECAYED(LT(-a, SET(40.0)), a)",
    "LOGIC": "SELECT((LT(SET(0.0), a) & NOT(EQ(a, SET(1.0)))) | NE(a, a), SET(1.0), SET(0.0))",
}


def source() -> str:
    loops = "\n".join(
        f"""void run_{name}(const double *in, double *out, int n) {{
  for (int k = 0; k < n; k += W) {{
    const V a = *(const M *)(in + k);
    *(M *)(out + k) = {expression};
  }}
}}"""
        for name, expression in FUNCTIONS.items()
    )
    return f"{LANES}\nint width(void) {{ return W; }}\n{loops}\n"


@pytest.fixture(params=WIDTHS, scope="module")
def library(request: pytest.FixtureRequest) -> ctypes.CDLL:
    compiler = find_compiler()
    assert compiler is not None
    flags = (*VECTOR, *WIDTHS[request.param])
    loaded = ctypes.CDLL(str(compile_library(source(), flags, compiler)))
    assert loaded.width() <= {"native": 8, "at most 4": 4, "2": 2}[request.param]
    return loaded


def apply(library: ctypes.CDLL, name: str, values: Array) -> Array:
    given = np.ascontiguousarray(values[: values.size // 8 * 8])
    out = np.empty_like(given)
    getattr(library, f"run_{name}")(pointer(given), pointer(out), given.size)
    return out


def cut(values: Array) -> Array:
    return values[: values.size // 8 * 8]


def test_exponential(library: ctypes.CDLL) -> None:
    """To 2 units in the last place over the range of normal numbers, and clamped outside."""
    x = np.concatenate([np.linspace(-707.9, 709.0, 80_001), np.linspace(-1.0, 1.0, 8_001)])
    exact = np.array([math.exp(v) for v in cut(x)])
    assert (np.abs(apply(library, "EXP", x) - exact) / exact).max() < 2.0 * EPS
    far = np.array([-1e300, -5000.0, -745.2, -708.5, 0.0, -0.0, 1e-320, -1e-17])
    np.testing.assert_allclose(apply(library, "EXP", far), np.exp(far), atol=1e-300, rtol=EPS)
    near = np.linspace(-40.0, 2.0, 8_000)
    expected = np.where(near <= 1.0, np.exp(near), 0.0)
    np.testing.assert_allclose(apply(library, "EXP_WHERE", near), expected, rtol=2.0 * EPS)
    below = np.array([-1e300, -900.0, -40.0, -39.9, -1.0, -1e-9, -0.0, 0.0])
    whole = np.where(-below < 40.0, apply(library, "EXP", below), 0.0)
    np.testing.assert_array_equal(apply(library, "EXP_DECAYED", below), whole)


@pytest.mark.parametrize("reach", [math.pi, 100.0, 1e5])
def test_sine_and_cosine(library: ctypes.CDLL, reach: float) -> None:
    """To one unit of 1 over their range; the sine of a small angle keeps its own digits."""
    x = np.concatenate([np.linspace(-reach, reach, 80_001), np.pi / 4.0 * np.arange(-64, 64)])
    for name, function in (("SIN", math.sin), ("COS", math.cos)):
        exact = np.array([function(v) for v in cut(x)])
        assert np.abs(apply(library, name, x) - exact).max() <= EPS
    small = np.geomspace(1e-300, 0.7, 8_000)
    np.testing.assert_allclose(apply(library, "SIN", small), np.sin(small), rtol=2.0 * EPS)


def test_arithmetic(library: ctypes.CDLL) -> None:
    x = np.concatenate([np.geomspace(1e-280, 1e280, 8_000), -np.geomspace(1e-280, 1e280, 8_000)])
    np.testing.assert_allclose(apply(library, "INVERSE", x), 1.0 / x, rtol=2.0 * EPS)
    np.testing.assert_array_equal(apply(library, "FABS", x), np.abs(x))
    special = [-1.0, -0.5, 0.0, 0.5, 1.0, 0.3, 2.0, 3.0]
    steps = np.concatenate([np.linspace(-7.0, 7.0, 8_000), special])
    wanted = {
        "FLOOR": np.floor(steps),
        "MAX": np.maximum(steps, 0.3),
        "MIN": np.minimum(steps, 0.3),
        "SELECT": np.where(steps < 0.3, steps, 2.0),
        "LOGIC": np.where((steps > 0.0) & (steps != 1.0), 1.0, 0.0),
    }
    for name, expected in wanted.items():
        np.testing.assert_array_equal(apply(library, name, steps), expected, err_msg=name)
    positive = np.geomspace(1e-10, 1e10, 8_000)
    for name, expected in (
        ("SQRT", np.sqrt(positive)),
        ("LOG", np.log(positive)),
        ("POW", positive**1.7),
        ("TAN", np.tan(positive)),
    ):
        np.testing.assert_allclose(
            apply(library, name, positive), expected, rtol=4.0 * EPS, atol=4.0 * EPS, err_msg=name
        )


@pytest.mark.parametrize("width", WIDTHS)
def test_kernels_of_every_width(width: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The contacts of a wedge brake in lanes give the same run on any processor."""
    monkeypatch.setattr(case_kernels, "VECTOR", (*VECTOR, *WIDTHS[width]))
    monkeypatch.setattr(
        case_kernels,
        "lane_kernel",
        lambda prepared, *rest: case_kernels.LaneKernel.of(prepared.program, *rest),
    )
    run, names = heart(0.02), ["X_1", "x", "f_1"]
    result = ensemble.simulate_ensemble(run, {"F_S0": [250.0, 260.0, 270.0]}, names)
    single = simulate(run, names)
    scale = np.abs(single.values).max(axis=0)
    assert (np.abs(result.values[0] - single.values) / scale).max() < 1e-9
    assert np.abs(result.values[2] - single.values).max() > 0.0
