"""A client of FMI 2.0 over FMPy: instances of a written FMU, their variables by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave


class Client:
    """One instance; ``said`` contains its log messages."""

    def __init__(
        self, path: Path, folder: Path, start: float = 0.0, stop: float | None = None
    ) -> None:
        self.description = read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        if not (folder / "modelDescription.xml").exists():
            extract(str(path), unzipdir=str(folder))
        self.folder = folder
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            instanceName="test",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate(loggingOn=True)
        self.fmu.setupExperiment(startTime=start, stopTime=stop)
        self.fmu.enterInitializationMode()
        self.time = start

    def begin(self, **parameters: float) -> Client:
        for name, value in parameters.items():
            self[name.replace("__", ".")] = value
        self.fmu.exitInitializationMode()
        return self

    def of(self, causality: str) -> list[str]:
        return [v.name for v in self.description.modelVariables if v.causality == causality]

    def __getitem__(self, name: str) -> float:
        return float(self.fmu.getReal([self.references[name]])[0])

    def __setitem__(self, name: str, value: float) -> None:
        self.fmu.setReal([self.references[name]], [value])

    def values(self, names: list[str]) -> list[float]:
        got: list[float] = self.fmu.getReal([self.references[name] for name in names])
        return got

    def set(self, names: list[str], values: Any) -> None:
        self.fmu.setReal([self.references[name] for name in names], list(values))

    def step(self, length: float) -> None:
        self.fmu.doStep(self.time, length)
        self.time += length

    def reference(self) -> np.ndarray:
        path = self.folder / "documentation" / "reference.csv"
        return np.genfromtxt(path, delimiter=",", names=True)

    def follow(self, length: float, begin: int = 0, end: int | None = None) -> list[list[float]]:
        """Drive the instance like the bench, row by row; return sampled signals by step."""
        reference = self.reference()
        inputs, sampled = self.of("input"), self.of("local")
        every = round(length / (reference["time"][1] - reference["time"][0]))
        rows = []
        for row in range(begin, len(reference) - 1 if end is None else end, every):
            self.set(inputs, [reference[name][row] for name in inputs])
            self.step(length)
            rows.append(self.values(sampled))
        return rows
