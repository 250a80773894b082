"""bywire: a virtual test bench for brake-by-wire actuators.

Everything below is loaded on first use, so that ``import bywire`` costs nothing.

>>> import bywire
>>> bench = bywire.Bench("hard-braking", "dardanelli2010", overrides={"motor.R_m": "0.4 ohm"})
>>> bench.par.motor.R_m
0.4
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

from bywire.core.engines import Make as _Make
from bywire.core.engines import declare_engine as _declare_engine
from bywire.core.lazy_names import LazyNames as _LazyNames
from bywire.core.version import __version__ as __version__


def _ecu_in_the_loop(precision: str) -> _Make:
    """Return what makes the engine whose ticks are the compiled C of the ECU."""

    def make(model: Any, par: Any, kernel: Any) -> Any:
        from bywire.export.controller.in_the_loop import SoftwareInTheLoop

        return SoftwareInTheLoop(model, par, precision, kernel)

    return make


_declare_engine("sil", _ecu_in_the_loop("double"))
_declare_engine("sil-single", _ecu_in_the_loop("single"))


class _Names(_LazyNames):
    """The names of the stub, and every use case that it may lack yet."""

    @cached_property
    def homes(self) -> dict[str, tuple[str, str]]:
        """Name -> module, and what it is called there."""
        from bywire.usecases import use_cases

        found = {name: (case.public.__module__, name) for name, case in use_cases().items()}
        return found | super().homes


_names = _Names(__file__)


def __getattr__(name: str) -> Any:
    return _names.load(name)


def __dir__() -> list[str]:
    return sorted([*_names.all(), "__version__"])
