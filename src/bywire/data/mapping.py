"""What the columns of a measurement file mean: signals, units, signs, offsets, delays, instants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Clock:
    """Where the instants of signals come from: a column, or a sample rate.

    Parameters
    ----------
    column
        Column of the instants; empty where a rate is given.
    unit
        Its unit; empty where the file says it.
    rate
        Sample rate [Hz]; 0 where there is a column.
    start
        Instant of the first sample [s], of a rate.
    number
        Number of the column, from 1; 0 where its name tells it.
    """

    column: str = ""
    unit: str = ""
    rate: float = 0.0
    start: float = 0.0
    number: int = 0


@dataclass(frozen=True)
class SignalMapping:
    """What a column means: value = sign * scale * number [unit] + offset.

    Parameters
    ----------
    name
        Name of the signal.
    column
        Column of the file.
    unit
        Unit of the scaled number; empty where the file says it.
    scale, sign
        Factors of the number in the file; ``scale`` is None where the file's unit is to hold.
    offset
        Added to the value, in SI.
    delay
        How much later than the quantity the column shows it [s]: instants are moved back by it.
    limits
        Range of the sensor in SI, at whose ends it is clipped; None where it is not known.
    label
        Description, for figures.
    clock
        Where its instants come from; None for those of the whole file.
    number
        Number of the column, from 1; 0 where its name tells it.
    missing
        Numbers and texts in the file that say that nothing was measured.
    """

    name: str
    column: str
    unit: str = ""
    scale: float | None = None
    sign: int = 1
    offset: float = 0.0
    delay: float = 0.0
    limits: tuple[float, float] | None = None
    label: str = ""
    clock: Clock | None = None
    number: int = 0
    missing: tuple[float | str, ...] = ()


@dataclass(frozen=True)
class MeasurementMapping:
    """What a measurement file means.

    Parameters
    ----------
    signals
        The columns that are wanted; empty for all of them, under their own names and units.
    clock
        Where the instants come from; None where the file says it.
    format
        Name of the file's format; empty where ending and content tell it.
    decimal, skip_lines, titles, encoding
        See `ReadOptions`.
    missing
        Numbers and texts in the file that say that nothing was measured, beside the usual ones.
    """

    signals: Mapping[str, SignalMapping] = field(default_factory=dict)
    clock: Clock | None = None
    format: str = ""
    decimal: str = ""
    skip_lines: int = 0
    titles: bool | None = None
    encoding: str = ""
    missing: tuple[float | str, ...] = ()

    @property
    def marks(self) -> tuple[str, ...]:
        """Every cell of a text table that says that nothing was measured."""
        every = (*self.missing, *(mark for s in self.signals.values() for mark in s.missing))
        return tuple(mark for mark in every if isinstance(mark, str))
