"""bywire: a virtual test bench for brake-by-wire actuators.

Everything below is loaded on first use, so that ``import bywire`` costs nothing.

>>> import bywire
>>> bench = bywire.Bench("hard-braking", "dardanelli2010", overrides={"motor.R_m": "0.4 ohm"})
>>> bench.par.motor.R_m
0.4
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from bywire.core.engines import Make as _Make
from bywire.core.engines import declare_engine as _declare_engine
from bywire.core.version import __version__ as __version__


def _ecu_in_the_loop(precision: str) -> _Make:
    """Return what makes the engine whose ticks are the compiled C of the ECU."""

    def make(model: Any, par: Any, kernel: Any) -> Any:
        from bywire.export.controller.in_the_loop import SoftwareInTheLoop

        return SoftwareInTheLoop(model, par, precision, kernel)

    return make


_declare_engine("sil", _ecu_in_the_loop("double"))
_declare_engine("sil-single", _ecu_in_the_loop("single"))


@cache
def _homes() -> dict[str, str]:
    """Return the module of each public name: those of the stub beside this file, and use cases."""
    from bywire.usecases import use_cases

    lines = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8").splitlines()
    words = [line.split() for line in lines if line.startswith("from ")]
    stated = {name: home for _, home, _, name, *_ in words if not name.startswith("_")}
    return stated | {name: case.public.__module__ for name, case in use_cases().items()}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return sorted(_homes())
    home = None if name.startswith("_") else _homes().get(name)
    if home is None:
        raise AttributeError(f"module 'bywire' has no attribute {name!r}")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return sorted([*_homes(), "__version__"])
