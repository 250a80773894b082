"""bywire: a virtual test bench for brake-by-wire actuators.

Everything below is loaded on first use, so that ``import bywire`` costs nothing.

>>> import bywire
>>> bench = bywire.Bench("hard-braking", "dardanelli2010", overrides={"motor.R_m": "0.4 ohm"})
>>> bench.par.motor.R_m
0.4
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bywire.core.engines import Make as _Make
from bywire.core.engines import declare_engine as _declare_engine
from bywire.core.version import __version__ as __version__

if TYPE_CHECKING:
    from bywire.api.agreement import agreement
    from bywire.api.check import Check, check
    from bywire.api.compare import compare
    from bywire.api.comparison import Comparison
    from bywire.api.convert import Conversion, convert
    from bywire.api.describe import describe
    from bywire.api.design import design
    from bywire.api.export_controller import ControllerExport, export_controller
    from bywire.api.export_fmu import ExportedFmu, export_fmu
    from bywire.api.export_wasm import ExportedWasm, export_wasm
    from bywire.api.frequency_response import frequency_response
    from bywire.api.identification import Identification
    from bywire.api.identify import identify
    from bywire.api.life import LifeResult, project_life
    from bywire.api.linearize import linearize
    from bywire.api.margins import margins
    from bywire.api.new import NewBrake, new
    from bywire.api.overview import overview
    from bywire.api.page import BenchPage, page
    from bywire.api.replay import replay
    from bywire.api.replay_answer import Replay
    from bywire.api.reproduce import reproduce
    from bywire.api.run import BenchResult, run
    from bywire.api.run_faults import run_faults
    from bywire.api.run_over import BenchRange
    from bywire.api.run_study import resume_study, run_study, study_report
    from bywire.api.study import study
    from bywire.api.study_run import StudyRun
    from bywire.api.study_surrogate import study_surrogates
    from bywire.api.trust import TrustStudy, trust
    from bywire.bench.bench import Bench
    from bywire.bench.bench_file import load
    from bywire.bench.ensemble import BenchEnsemble, simulate_ensemble
    from bywire.core.brake import Brake, load_system
    from bywire.core.catalog import CitedSet, parameters
    from bywire.core.errors import BywireError
    from bywire.data.alignment import resample
    from bywire.data.measurement import read_measurement
    from bywire.data.netcdf import read_recording, write_recording
    from bywire.data.writing import write_measurement
    from bywire.identification.fitting.question import Question
    from bywire.server.serving import serve
    from bywire.simulation.ensemble import Ensemble
    from bywire.simulation.run import Run, Trajectory, simulate
    from bywire.simulation.sensitivity import Sensitivity, simulate_with_sensitivities

_HOMES = {
    "Bench": "bench.bench",
    "Brake": "core.brake",
    "CitedSet": "core.catalog",
    "BywireError": "core.errors",
    "Conversion": "api.convert",
    "Ensemble": "simulation.ensemble",
    "BenchEnsemble": "bench.ensemble",
    "BenchRange": "api.run_over",
    "BenchResult": "api.run",
    "ControllerExport": "api.export_controller",
    "export_controller": "api.export_controller",
    "Check": "api.check",
    "check": "api.check",
    "Comparison": "api.comparison",
    "compare": "api.compare",
    "Question": "identification.fitting.question",
    "Identification": "api.identification",
    "Replay": "api.replay_answer",
    "Run": "simulation.run",
    "Sensitivity": "simulation.sensitivity",
    "Trajectory": "simulation.run",
    "StudyRun": "api.study_run",
    "run_faults": "api.run_faults",
    "run_study": "api.run_study",
    "resume_study": "api.run_study",
    "study_report": "api.run_study",
    "study_surrogates": "api.study_surrogate",
    "TrustStudy": "api.trust",
    "convert": "api.convert",
    "identify": "api.identify",
    "load": "bench.bench_file",
    "load_system": "core.brake",
    "parameters": "core.catalog",
    "read_measurement": "data.measurement",
    "read_recording": "data.netcdf",
    "replay": "api.replay",
    "resample": "data.alignment",
    "agreement": "api.agreement",
    "frequency_response": "api.frequency_response",
    "project_life": "api.life",
    "LifeResult": "api.life",
    "linearize": "api.linearize",
    "design": "api.design",
    "ExportedFmu": "api.export_fmu",
    "export_fmu": "api.export_fmu",
    "ExportedWasm": "api.export_wasm",
    "export_wasm": "api.export_wasm",
    "study": "api.study",
    "reproduce": "api.reproduce",
    "describe": "api.describe",
    "overview": "api.overview",
    "BenchPage": "api.page",
    "page": "api.page",
    "margins": "api.margins",
    "new": "api.new",
    "NewBrake": "api.new",
    "run": "api.run",
    "serve": "server.serving",
    "simulate": "simulation.run",
    "simulate_ensemble": "bench.ensemble",
    "simulate_with_sensitivities": "simulation.sensitivity",
    "trust": "api.trust",
    "write_measurement": "data.writing",
    "write_recording": "data.netcdf",
}

__all__ = [
    "Bench",
    "BenchEnsemble",
    "BenchPage",
    "BenchRange",
    "BenchResult",
    "Brake",
    "BywireError",
    "Check",
    "CitedSet",
    "Comparison",
    "ControllerExport",
    "Conversion",
    "Ensemble",
    "ExportedFmu",
    "ExportedWasm",
    "Identification",
    "LifeResult",
    "NewBrake",
    "Question",
    "Replay",
    "Run",
    "Sensitivity",
    "StudyRun",
    "Trajectory",
    "TrustStudy",
    "agreement",
    "check",
    "compare",
    "convert",
    "describe",
    "design",
    "export_controller",
    "export_fmu",
    "export_wasm",
    "frequency_response",
    "identify",
    "linearize",
    "load",
    "load_system",
    "margins",
    "new",
    "overview",
    "page",
    "parameters",
    "project_life",
    "read_measurement",
    "read_recording",
    "replay",
    "reproduce",
    "resample",
    "resume_study",
    "run",
    "run_faults",
    "run_study",
    "serve",
    "simulate",
    "simulate_ensemble",
    "simulate_with_sensitivities",
    "study",
    "study_report",
    "study_surrogates",
    "trust",
    "write_measurement",
    "write_recording",
]


def _ecu_in_the_loop(precision: str) -> _Make:
    """Return what makes the engine whose ticks are the compiled C of the ECU."""

    def make(model: Any, par: Any, kernel: Any) -> Any:
        from bywire.export.controller.in_the_loop import SoftwareInTheLoop

        return SoftwareInTheLoop(model, par, precision, kernel)

    return make


_declare_engine("sil", _ecu_in_the_loop("double"))
_declare_engine("sil-single", _ecu_in_the_loop("single"))


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'bywire' has no attribute {name!r}")
    return getattr(import_module(f"bywire.{home}"), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
