"""Parameters vary as they were measured: estimates of an identification, with their covariance."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bywire.bench.bench import Bench
from bywire.core.errors import FileError, ParameterError, quoted, unknown_name
from bywire.core.parameters import leaf_fields
from bywire.core.section import Hint, Name, Names, Section
from bywire.studies.distribution_section import read_distribution
from bywire.studies.plan import Varied

ESTIMATE = "estimate.json"
"""file of an identification's folder that holds its estimates"""
_LARGEST = 20_000_000  # bytes of a file that is read
_TRUNCATE = "cut it off, with truncate = true"
_WEAK = 1e-9  # correlation that counts as none


class MeasuredSection(Section):
    """The section ``[measured]``: estimates of an identification, of which parameters vary."""

    file: Annotated[Name, Hint("name the folder that 'bywire identify --out' has written")]
    of: Names | None = None
    truncate: bool = False


@dataclass(frozen=True)
class Measured:
    """Estimated parameters.

    Parameters
    ----------
    values, deviations
        By name [SI]: estimate and standard deviation.
    units
        SI unit by name.
    correlations
        Pairs of names, in alphabetical order -> correlation of their estimates.
    """

    values: Mapping[str, float]
    deviations: Mapping[str, float]
    units: Mapping[str, str]
    correlations: Mapping[tuple[str, str], float]

    def only(self, names: Sequence[str]) -> Measured:
        """Return some of the estimates.

        Raises
        ------
        UnknownNameError
            When one was not estimated.
        """
        for name in names:
            if name not in self.values:
                raise unknown_name("estimate in [measured] of", name, self.values)
        return Measured(
            {n: self.values[n] for n in names},
            {n: self.deviations[n] for n in names},
            {n: self.units[n] for n in names},
            {pair: c for pair, c in self.correlations.items() if set(pair) <= set(names)},
        )


def varied_as_measured(
    bench: Bench, section: MeasuredSection, folder: Path
) -> tuple[tuple[Varied, ...], dict[tuple[str, str], float]]:
    """Return parameters that vary as they were measured, and the correlations of their estimates.

    Each is normal, with its estimate as mean.

    Parameters
    ----------
    bench
        What is tested.
    section
        ``[measured]`` of a study file: ``file``; ``of``, names, by default all that the bench has;
        ``truncate``, whether what leaves the admissible range is cut off.
    folder
        Where the path of the file starts.

    Raises
    ------
    InputError
        For a section that does not fit, and estimates that leave the admissible range.
    """
    measured = read_measured(folder / section.file)
    leaves, values = leaf_fields(type(bench.par)), bench.par.flat()
    of = [name for name in measured.values if name in leaves] if section.of is None else section.of
    if not of:
        raise ParameterError(
            f"[measured] {section.file} has estimates of {', '.join(measured.values)}: "
            "name some of them with of = [...] that the bench has too"
        )
    chosen = measured.only(of)
    varied = []
    for name, value in chosen.values.items():
        if name not in leaves:
            raise unknown_name("parameter of [measured]", name, leaves)
        leaf, unit = leaves[name], chosen.units[name]
        entry = {
            "kind": "normal",
            "mean": _text(value, unit),
            "sd": _text(chosen.deviations[name], unit),
        }
        ends = {"low": leaf.low, "high": leaf.high} if section.truncate else {}
        symbol = leaf.unit.symbol
        entry |= {key: _text(x, symbol) for key, x in ends.items() if math.isfinite(x)}
        nominal = float(values[name])
        law = read_distribution(name, entry, leaf, nominal, "[measured]", _TRUNCATE)
        varied.append(Varied(name, leaf.unit.symbol, nominal, law))
    return tuple(varied), dict(chosen.correlations)


def _text(value: float, unit: str) -> str:
    """Return a value as a study file has it; a pure number has no unit."""
    return repr(value) if unit == "1" else f"{value!r} {unit}"


def read_measured(path: Path) -> Measured:
    """Read what an identification estimated.

    Parameters
    ----------
    path
        Folder that ``bywire identify --out`` has written, or its ``estimate.json``.

    Raises
    ------
    FileError
        When there is none, or it is damaged.
    """
    file = path / ESTIMATE if path.is_dir() else path
    try:
        data = file.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot read {file}: {reason}: name the folder that 'bywire identify --out' has "
            "written"
        ) from None
    try:
        if len(data) > _LARGEST:
            raise ValueError("it is far too large")
        said = json.loads(data)
        return _joined(list(_estimates(said["estimates"])))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError(
            f"{file} holds no estimates of an identification ({type(error).__name__}: "
            f"{quoted(str(error))}): name the folder that 'bywire identify --out' has written"
        ) from None


def _estimates(said: Mapping[str, Any]) -> Iterator[Measured]:
    for each in said.values():
        rows = each["parameters"]
        values = {str(name): _number(row["value"]) for name, row in rows.items()}
        deviations = {str(name): _number(row["standard_deviation"]) for name, row in rows.items()}
        if not all(d > 0.0 for d in deviations.values()):
            raise ValueError("a standard deviation is not above zero")
        names = [str(name) for name in each["correlation"]["names"]]
        matrix = np.array(each["correlation"]["matrix"], dtype=float)
        if matrix.shape != (len(names), len(names)) or {*names} != {*values}:
            raise ValueError("the correlations are of other parameters")
        pairs = {
            (min(a, b), max(a, b)): _number(float(matrix[i, k]))
            for (i, a), (k, b) in combinations(enumerate(names), 2)
            if abs(matrix[i, k]) > _WEAK
        }
        units = {str(name): str(row["unit"]) for name, row in rows.items()}
        yield Measured(values, deviations, units, pairs)


def _joined(each: Sequence[Measured]) -> Measured:
    """Return several estimates as one: those of different ones are independent."""
    names = [name for file in each for name in file.values]
    if not names:
        raise ParameterError("nothing is estimated in it")
    if len(names) != len({*names}):
        twice = next(name for name in names if names.count(name) > 1)
        raise ParameterError(f"{twice} is estimated twice in it")
    return Measured(
        {k: v for file in each for k, v in file.values.items()},
        {k: v for file in each for k, v in file.deviations.items()},
        {k: v for file in each for k, v in file.units.items()},
        {k: v for file in each for k, v in file.correlations.items()},
    )


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{quoted(value)} is no number")
    return float(value)
