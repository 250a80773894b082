"""Effort of an experiment: currents, powers and energy."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples, integral


@dataclass(frozen=True)
class Setting:
    """Names of the signals in the recording.

    Parameters
    ----------
    current
        Motor current [A].
    power
        Electrical power drawn [W].
    energy
        Energy drawn since the start [J]. Without this signal, the power is integrated over the
        samples, which misses changes between samples.
    """

    current: str = "i"
    power: str = "P_el"
    energy: str = "E_source"


@measure("A")
def peak_current(current: Samples | None) -> float | Undefined:
    """Maximum magnitude of the motor current.

    Evaluated at the recorded samples, including dither and ripple.
    """
    if current is None:
        return Undefined("no current is recorded")
    return max(max(current), -min(current))


@measure("A")
def mean_current(t: Samples, current: Samples | None) -> float | Undefined:
    """Time average of the motor current's magnitude.

    Trapezoidal rule over the samples. Dither is fully included, even if it reverses the current.
    """
    if current is None:
        return Undefined("no current is recorded")
    magnitude = [abs(i) for i in current]
    return integral(t, magnitude) / (t[-1] - t[0])


@measure("W")
def peak_power(power: Samples | None) -> float | Undefined:
    """Maximum electrical power drawn from the battery or source.

    Power that is fed back is negative. Evaluated at the recorded samples, including dither and
    ripple.
    """
    if power is None:
        return Undefined("no electrical power is recorded")
    return max(power)


@measure("W")
def mean_power(t: Samples, energy: Samples | None, power: Samples | None) -> float | Undefined:
    """Energy drawn, divided by the duration of the recording."""
    joule = _drawn(t, energy, power)
    return joule if isinstance(joule, Undefined) else joule / (t[-1] - t[0])


@measure("J")
def energy(t: Samples, energy: Samples | None, power: Samples | None) -> float | Undefined:
    """Energy drawn from the battery or source during the recording.

    The recorded energy at the end minus that at the start. If no energy is recorded, the recorded
    power is integrated by the trapezoidal rule.
    """
    return _drawn(t, energy, power)


def _drawn(t: Samples, energy: Samples | None, power: Samples | None) -> float | Undefined:
    if energy is not None:
        return energy[-1] - energy[0]
    if power is not None:
        return integral(t, power)
    return Undefined("neither energy nor electrical power is recorded")
