"""A library of one function, which tests of the compiler and of its cache build."""

from __future__ import annotations

import ctypes
from pathlib import Path

from bywire.simulation.compiler import Compiler, find_compiler

SOURCE = "double twice(double x) { return 2.0 * x; }\n"


def system_compiler() -> Compiler:
    found = find_compiler()
    assert found is not None
    return found


def twice(library: Path) -> float:
    function = ctypes.CDLL(str(library)).twice
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    return float(function(21.0))
