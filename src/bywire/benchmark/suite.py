"""The whole benchmark, in one run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.wedge_parameters import WedgeParameters
from bywire.benchmark import frequency, identification, measurement_files, wedge_brake
from bywire.benchmark.engine import ensemble, single_and_sensitivities
from bywire.benchmark.others import others
from bywire.benchmark.processes import processes
from bywire.benchmark.result import Result, machine
from bywire.catalog.registry import parameters
from bywire.core.errors import CompilerError
from bywire.report.tables import Table, text_table
from bywire.simulation.compiler import find_compiler


@dataclass(frozen=True)
class Benchmark:
    """All figures, and the machine."""

    machine: dict[str, object]
    results: tuple[Result, ...]


def measure(progress: Callable[[str, float], None] | None = None) -> Benchmark:
    """Measure everything; takes a minute or two.

    Raises
    ------
    CompilerError
        Without a C compiler there is nothing to compare.
    """
    if find_compiler() is None:
        raise CompilerError("the benchmark compares compiled C: install a C compiler")
    par, wedge = parameters("dardanelli2010"), parameters("roberts2003")
    assert isinstance(par, MotorcycleParameters)
    assert isinstance(wedge, WedgeParameters)
    parts: dict[str, Callable[[], list[Result]]] = {
        "single run": lambda: single_and_sensitivities(par),
        "ensemble": lambda: ensemble(par),
        "other simulators": lambda: others(par),
        "wedge brake": lambda: wedge_brake.measured(wedge),
        "frequency responses": lambda: frequency.measured(wedge),
        "measurement files": measurement_files.measured,
        "identification": lambda: identification.measured(par),
        "start-up": processes,
    }
    here = machine()
    results: list[Result] = []
    for label, part in parts.items():
        if progress is not None:
            progress(f"benchmark: {label}", 0.0)
        results += part()
        if progress is not None:
            progress(f"benchmark: {label}", 1.0)
    return Benchmark(here, tuple(results))


def as_json(found: Benchmark) -> dict[str, Any]:
    """Return the object that ``bywire benchmark --json`` prints."""
    return {
        "machine": found.machine,
        "results": [
            {
                "id": r.id,
                "value": r.value,
                "unit": r.unit,
                "goal": r.goal,
                "holds": r.holds,
                "note": r.note,
            }
            for r in found.results
        ],
    }


def as_table(found: Benchmark) -> Table:
    """Return the figures as a table."""
    verdict = {True: "yes", False: "no", None: "-"}
    rows = [
        (
            r.id,
            "-" if r.value is None else f"{r.value:.3g} {r.unit}",
            r.goal or "-",
            verdict[r.holds],
            r.note,
        )
        for r in found.results
    ]
    return text_table(("figure", "value", "goal", "holds", "how"), rows)
