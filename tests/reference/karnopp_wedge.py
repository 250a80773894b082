"""Reference for the wedge brake: Runge-Kutta of order 4 in small steps, friction after Karnopp.

Equations and controllers are written anew in C, beside this file; the package gives a compiler
only. Within a band around zero speed a body sticks where friction can hold the other forces, and
slides with full friction where it cannot; a speed that steps across the band counts as within,
so that the band may go to zero. Contacts are found by enumeration, the encoder is ideal.

References: D. Karnopp, "Computer simulation of stick-slip friction in mechanical dynamic systems",
ASME Journal of Dynamic Systems, Measurement, and Control, 1985; equations of the brake: R. Roberts,
M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the Mechatronic Wedge Brake",
SAE, 2003.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import CompilerError
from bywire.simulation.compiler import compile_library, find_compiler

Array = NDArray[np.float64]
Signal = Callable[[Array], Array]

ONE = ("demand", "sensed", "integral", "i", "theta", "omega")
STATES = (*(f"{name}_{k}" for k in (1, 2) for name in ONE), "x", "v", "Omega", "phi", "y_M")
SIGNALS = (*STATES, "mode", "F_N", "M_B", "f_1", "f_2", "f_12")
CHOICES = {
    "screw.law": ("load", "drive", "screw_by_torque"),
    "wedge_friction.stopped_disc": ("drop", "stick", "disc_holds"),
    "flywheel.law": ("coasting", "driven", "driven"),
    "control.offset.law": ("preload", "scheduled", "scheduled"),
}
"""choices that the reference knows: two values, and the C code's name of the second"""
FIXED = {"caliper.law": "linear", "encoder.law": "ideal", "command.mode": "moment"}
"""the only values that it knows"""
DISC = 1e-3
"""band of the disc over that of the shafts: its friction changes its speed as much more slowly"""
FLAGS = ("-O3", "-march=native")  # many steps of one small function
_FILES = ("karnopp_wedge_control.c", "karnopp_wedge.c")


@cache
def _library(names: tuple[str, ...]) -> ctypes.CDLL:
    """Return the compiled reference for the names of its parameters."""
    compiler = find_compiler()
    if compiler is None:
        raise CompilerError("the reference of the wedge brake needs a C compiler: install one")
    fields = "".join(f"    double {name};\n" for name in names)
    parts = [Path(__file__).with_name(name).read_text() for name in _FILES]
    source = "\n".join((f"typedef struct {{\n{fields}}} Par;\n", *parts))
    library = ctypes.CDLL(str(compile_library(source, FLAGS, compiler)))
    library.karnopp_run.restype = None
    return library


def run(
    values: Mapping[str, Any],
    duration: float,
    band: float,
    step: float,
    M_set: Signal,
    power_off: Signal = np.zeros_like,
) -> dict[str, Array]:
    """Simulate from the parking position.

    Parameters
    ----------
    values
        Parameters by their dotted names, numbers and choices.
    duration, step
        Length and step [s]; the step divides the sample time of the position control.
    band
        Karnopp's band of the shafts' speed [rad/s], and as much travel per time of the wedge; 0
        leaves what steps across zero.
    M_set, power_off
        Signals of time: moment demand [N m], power stages switched off.

    Returns
    -------
    dict
        ``t`` and all of ``SIGNALS`` at the position control's ticks, each of shape (rows,).

    Raises
    ------
    ValueError
        Where a choice is not known.
    CompilerError
        Without a C compiler.
    """
    numbers = _numbers(values)
    T, T_slow = numbers["control_T_fast"], numbers["control_T_slow"]
    ticks, substeps, ratio = round(duration / T), round(T / step), round(T_slow / T)
    t = T * np.arange(ticks + 1, dtype=np.float64)
    travel = numbers["screw_lead"] / (2.0 * math.pi)
    bands = np.array([band, band, band * travel, band * DISC])
    rows = np.empty((ticks + 1, len(SIGNALS)))
    arrays = [np.array(list(numbers.values())), bands]
    arrays += [np.ascontiguousarray(s(t), dtype=np.float64) for s in (M_set, power_off)]
    par, bands_at, *signals, rows_at = (ctypes.c_void_p(a.ctypes.data) for a in (*arrays, rows))
    counts = map(ctypes.c_int, (ticks, substeps, ratio))
    _library(tuple(numbers)).karnopp_run(par, bands_at, *counts, *signals, rows_at)
    return {"t": t} | dict(zip(SIGNALS, rows.T, strict=True))


def _numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters by their names in C, choices as 0 or 1."""
    found = {k.replace(".", "_"): v for k, v in values.items() if isinstance(v, float)}
    for name, (first, second, flag) in CHOICES.items():
        if values[name] not in (first, second):
            raise ValueError(f"{name} = {values[name]!r}: the reference knows {first}, {second}")
        found[flag] = float(values[name] == second)
    for name, wanted in FIXED.items():
        if values[name] != wanted:
            raise ValueError(f"{name} = {values[name]!r}: the reference knows {wanted!r} only")
    return found
