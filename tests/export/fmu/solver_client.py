"""A model-exchange client that calls an FMU with FMPy, and a SciPy solver with its events."""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import POINTER, c_double
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model
from scipy.integrate import Radau


class SolverClient:
    """One instance of version 2.0, integrated from one time to the next."""

    def __init__(self, path: Path) -> None:
        self.description = read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        folder = path.with_suffix("")
        if not (folder / "modelDescription.xml").exists():
            extract(str(path), unzipdir=str(folder))
        self.fmu = FMU2Model(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            instanceName="test",
            modelIdentifier=self.description.modelExchange.modelIdentifier,
        )
        self.fmu.instantiate(loggingOn=True)
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.time = 0.0
        self.count = self.description.numberOfContinuousStates
        self.indicators = self.description.numberOfEventIndicators

    def begin(self, **parameters: float) -> SolverClient:
        self.set({name.replace("__", "."): value for name, value in parameters.items()})
        self.fmu.exitInitializationMode()
        self._take_modes()
        return self

    def of(self, causality: str) -> list[str]:
        return [v.name for v in self.description.modelVariables if v.causality == causality]

    def set(self, values: Mapping[str, float]) -> None:
        self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def __getitem__(self, name: str) -> float:
        return float(self.fmu.getReal([self.references[name]])[0])

    def event(self, inputs: Mapping[str, float] = MappingProxyType({})) -> None:
        """Set inputs, and let modes follow."""
        self.fmu.enterEventMode()
        self.set(inputs)
        self._take_modes()

    def _take_modes(self) -> None:
        while self.fmu.newDiscreteStates()[0]:
            pass
        self.fmu.enterContinuousTimeMode()

    def _filled(self, call: Any, count: int) -> np.ndarray:
        values = np.empty(count)
        call(values.ctypes.data_as(POINTER(c_double)), count)
        return values

    def _place(self, time: float, states: np.ndarray) -> None:
        self.fmu.setTime(time)
        given = np.ascontiguousarray(states)
        self.fmu.setContinuousStates(given.ctypes.data_as(POINTER(c_double)), self.count)

    def _derivatives(self, time: float, states: np.ndarray) -> np.ndarray:
        self._place(time, states)
        return self._filled(self.fmu.getDerivatives, self.count)

    def _is_due(self, time: float, states: np.ndarray) -> bool:
        self._place(time, states)
        return bool(np.any(self._filled(self.fmu.getEventIndicators, self.indicators) < 0.0))

    def follow(self, length: float, tolerance: float) -> None:
        """Integrate over an interval with constant inputs, including all events."""
        end, close = self.time + length, 1e-14
        nominals = self._filled(self.fmu.getNominalsOfContinuousStates, self.count)
        while end - self.time > close:
            states = self._filled(self.fmu.getContinuousStates, self.count)
            solver = Radau(
                self._derivatives, self.time, states, end, rtol=tolerance, atol=tolerance * nominals
            )
            is_due = False
            while solver.status == "running" and not is_due:
                solver.step()
                is_due = self._is_due(solver.t, solver.y)
            before, after, between = solver.t_old, solver.t, solver.dense_output()
            while is_due and after - before > close:  # the far side: there the mode is another
                middle = 0.5 * (before + after)
                before, after = (
                    (before, middle) if self._is_due(middle, between(middle)) else (middle, after)
                )
            self.time = after
            self._place(after, between(after) if is_due else solver.y)
            if is_due:
                self.event()
