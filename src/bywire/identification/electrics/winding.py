"""A motor's winding alone: voltage and speed are what was measured, current is what answers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import xarray as xr

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency
from bywire.core.signals import Signal, zeros
from bywire.core.typing import Array
from bywire.identification.measured import require_signals
from bywire.identification.output_error import Driven, Trial, even_interval
from bywire.plant import anti_alias_filter, dc_motor
from bywire.simulation.run import Run

Amperes = Annotated[float, Signal("A", "motor current", 5.0)]
_SETTLED = 10.0  # time constants of the sensor's filter until the start is forgotten
_SUBSTEPS = 4  # per sample, at least
_LONGEST = 5e-6  # of a substep [s]: at 20 us L_m is 0.04 % off where L_m/R_m is 0.3 ms


class Parameters(ParameterSet):
    """Winding, and the filter in front of the converter."""

    motor: dc_motor.Parameters
    f_aa: Frequency
    """corner of the current measurement's filter"""
    T: Duration
    """how long an input is held"""


class Currents(NamedTuple):
    """Current, and current behind the filter."""

    i: Amperes
    i_meas: Annotated[float, Signal("A", "measured current", 5.0)]


class Inputs(NamedTuple):
    """What was measured: held between samples."""

    v: Annotated[float, Signal("V", "motor voltage", 5.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 20.0)]


class Winding(Driven):
    r"""Voltage and speed to measured current.

    .. math:: L_m \frac{di}{dt} = v - R_m i - K_e \Omega

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (1).
    """

    name: ClassVar[str] = "winding"
    State: ClassVar = Currents
    Input: ClassVar = Inputs

    def period(self, par: Parameters) -> float:
        """Return for how long an input is held [s]."""
        return par.T

    def mass(self, xe: Currents, par: Parameters) -> Currents:
        """Return the inductance."""
        return Currents(dc_motor.mass(dc_motor.State(xe.i), par.motor).i, 1.0)

    def balance(
        self, x: Currents, xe: Currents, m: Inputs, par: Parameters, contact: tuple[float, ...]
    ) -> Currents:
        """Return the voltage across the inductance, and the filter's rate."""
        voltage = dc_motor.balance(dc_motor.State(x.i), dc_motor.Input(m.v, m.omega), par.motor)
        filtered = anti_alias_filter.Parameters.model_construct(f_aa=par.f_aa)
        seen = anti_alias_filter.rate(
            anti_alias_filter.State(x.i_meas), anti_alias_filter.Input(x.i), filtered
        )
        return Currents(voltage.i, seen.y)


def winding_trial(
    motor: dc_motor.Parameters,
    data: xr.Dataset,
    names: Mapping[str, str],
    f_aa: float,
    sigma: float,
    label: str = "",
) -> Trial:
    """Return a record beside the winding.

    Parameters
    ----------
    motor
        Where the search begins.
    data
        Over ``time`` [s], evenly spaced.
    names
        What ``v``, ``omega`` and ``i`` are called in it.
    f_aa
        Corner of the current measurement's filter [Hz].
    sigma
        Noise of the current [A].

    Raises
    ------
    UnknownNameError
        When a signal is missing.
    ParameterError
        When time is not evenly spaced.
    """
    from scipy import interpolate

    require_signals(data, names.values())
    t = data["time"].values - data["time"].values[0]
    T = even_interval(t)
    step = T / max(_SUBSTEPS, int(np.ceil(T / _LONGEST - 1e-9)))
    v, omega, i = (data[names[key]].values for key in ("v", "omega", "i"))
    speed = interpolate.CubicSpline(t, omega)

    def stimulus(at: Array) -> Array:
        # Voltage is held from sample to sample; the speed goes on between them.
        index = np.clip(np.floor(at / T + 1e-6).astype(int), 0, v.size - 1)
        return np.column_stack((v[index], speed(at + 0.5 * step)))

    run = Run(
        Winding(),
        Parameters(motor=motor, f_aa=f_aa, T=step),
        Currents(float(i[0]), float(i[0])),
        zeros(Inputs),
        stimulus,
        (t.size - 1) * T,
        step,
        T,
    )
    forgotten = _SETTLED / (2.0 * np.pi * f_aa)
    return Trial(run, {"i_meas": i}, {"i_meas": sigma}, label, t >= forgotten)
