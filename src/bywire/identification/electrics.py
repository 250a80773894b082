"""Identification of electric drives: current loops from steps, and single windings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency
from bywire.core.signals import Signal, zeros
from bywire.core.typing import Array
from bywire.data.labeled import labeled, over
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import estimate
from bywire.identification.measured import require_signals, split, wrong_sign
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.output_error import (
    Driven,
    Trial,
    even_interval,
    moved_run,
    output_error,
    trial,
)
from bywire.identification.residuals import explained
from bywire.identification.unknown import parameters_of
from bywire.plant import anti_alias_filter, dc_motor
from bywire.simulation.run import Run, simulate

if TYPE_CHECKING:
    import xarray as xr

_AGAINST = -0.5  # correlation of demand and current below which one has the wrong sign
_EXPLAINED = 0.5  # minimum fraction of the variance: as much as the residual
_MISFIT = 1.3  # closed-loop noise is 1.04 times the sensor's, which is known to within 10 %


def levels(
    low: float, high: float, duration: float, dwell: float, interval: float, seed: int
) -> Callable[[Array], Array]:
    """Return a signal that steps between random levels, drawn from a seed.

    Parameters
    ----------
    low, high
        Ends of the range.
    duration, dwell, interval
        Length, time from step to step, sample time [s].
    """
    every = max(round(dwell / interval), 1)
    count = int(np.ceil(duration / (every * interval))) + 1
    values = np.random.default_rng(seed).uniform(low, high, count)
    values[0] = 0.5 * (low + high)

    def at(t: Array) -> Array:
        index = np.floor(np.round(t / interval, 6) / every).astype(int)
        return np.asarray(values[np.clip(index, 0, count - 1)])

    return at


def noise_of_levels(answer: Array, demand: Array) -> float:
    """Return the noise of a response [its unit], from differences while the demand is constant.

    Parameters
    ----------
    answer, demand
        Shape (n,).
    """
    still = np.convolve(np.diff(demand) == 0.0, np.ones(3), mode="valid") == 3
    second = np.diff(answer, 3)[: still.size]
    chosen = second[still] if still.sum() > 10 else second
    # Third differences of white noise have 20 times its variance.
    return max(float(np.median(np.abs(chosen))) / (0.6745 * math.sqrt(20.0)), 1e-9)


def require_steps(data: xr.Dataset, name: str, answer: str, label: str) -> None:
    """Reject a record whose demand does not move, or whose current has the wrong sign.

    A winding absorbs power at every frequency, and a current loop follows its demand: voltage or
    demand and current cannot have opposite signs on average.

    Parameters
    ----------
    data
        Signals over ``time`` [s].
    name, answer
        Names of demand and current.
    label
        Label of the record.

    Raises
    ------
    UnknownNameError
        When the demand is missing.
    ParameterError
        When it does not step, or the current has the wrong sign.
    """
    require_signals(data, [name])
    demand, current = data[name].values, data[answer].values
    if not float(np.ptp(demand)) > 0.0:
        raise ParameterError(
            f"{name} of record {label or '1'} does not change, so it determines neither the "
            "winding nor the gains. Step it between several levels with the rotor locked",
            name=name,
        )
    together = float(np.corrcoef(demand, current)[0, 1]) if np.ptp(current) > 0.0 else 0.0
    if together < _AGAINST:
        raise wrong_sign(f"{answer} of record {label or '1'}", name, f"correlation {together:.2f}")


def _identified_loop(
    trials: Sequence[Trial], par: ParameterSet, names: Sequence[str]
) -> Identified:
    """Estimate a closed loop's parameters from its runs.

    Parameters
    ----------
    trials
        Records with the loop's model.
    par
        Start of the search.
    names
        Unknown parameters.

    Raises
    ------
    ParameterError
        When nothing can be estimated.
    """
    fit = estimate(output_error(trials, parameters_of(par, names)))
    return Identified(
        estimates={"current loop": fit},
        parameters=believable(fit),
        checks=checks_of(trials, fit),
        curves=tuple(as_curve(t, fit) for t in trials),
    )


def believable(fit: Estimate) -> dict[str, float]:
    """Return the parameters by name, without those whose values are meaningless."""
    vague = fit.vague()
    return {name: value for name, value in fit.parameters().items() if name not in vague}


def checks_of(trials: Sequence[Trial], fit: Estimate) -> tuple[Check, ...]:
    """Check whether the model explains the current and the values are meaningful.

    A residual of pure noise does not prove a model: if the record is only noise, so is the residual
    of any model, even of one with zero response.
    """
    vague = fit.vague()
    said = "; ".join(f"{label} {reason}" for label, reason in vague.items())
    return (
        Check(
            "variance_explained",
            explained(trials, fit),
            limit=_EXPLAINED,
            at_least=True,
            note="fraction of the current's variance that the model predicts. A low fraction may "
            "mean that demand and current come from different tests",
        ),
        Check(
            "residual_over_noise",
            fit.rms,
            limit=_MISFIT,
            note="1 if only sensor noise remains",
        ),
        Check(
            "parameters_without_meaning",
            float(len(vague)),
            limit=0.0,
            note=said or "no value is at its bound or has a 95 % interval wider than +-100 %",
        ),
    )


def as_curve(trial: Trial, fit: Estimate) -> Curve:
    """Return measured and modeled current of a trial."""
    signal = next(iter(trial.measured))
    shared = {
        u.name: float(v)
        for u, v in zip(fit.unknowns, fit.values, strict=True)
        if u.trial in ("", trial.label)
    }
    computed = simulate(moved_run(trial.run, shared), (signal,))
    modeled = np.where(trial.rows(signal), computed[signal], np.nan)
    columns = {"measured": trial.measured[signal], "modeled": modeled}
    data = over(("time", computed.time, "s", "time"), columns, "A", "current")
    name = f"current-{trial.label}" if trial.label else "current"
    return Curve(name, "Measured current, and modeled current in the fitted part.", data, "time")


class LoopOptions(ParameterSet):
    """Unknowns, and the steps of the synthetic experiment."""

    unknowns: Literal["gains", "all"]
    """gains only (with a known winding), or gains and winding"""
    lead: Duration
    """initial part of a record to exclude, because the loop's earlier state is unknown"""
    dwell: Duration
    """synthetic: time from one step to the next"""
    duration: Duration
    """synthetic: length of the record"""

    def names(self, gains: tuple[str, ...], winding: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names to estimate."""
        return gains if self.unknowns == "gains" else (*gains, *winding)


def _without_lead(trial: Trial, data: xr.Dataset, lead: float) -> Trial:
    """Return a trial without the first seconds of its record.

    Parameters
    ----------
    trial
        Trial of a whole record.
    data
        That record, over ``time`` [s].
    lead
        Excluded time [s].
    """
    t = data["time"].values
    return replace(trial, used=t - t[0] >= lead)


# --- Gains of a current loop


@dataclass(frozen=True)
class CurrentLoop:
    """A current loop with unknown gains.

    Parameters
    ----------
    model
        Model of the loop and its plant.
    demand, current
        Names of demand and measured current in the record; the demand is the model's stimulus.
    computed
        The model's signal for comparison with the measured current.
    gains, winding
        Names of the parameters: the controller's, and resistance and inductance.
    held
        ``held(par, options)``: the parameters with a locked rotor.
    rest
        ``rest(par)``: state and memory at the start of a record; all zero if None.
    """

    model: Model
    demand: str
    current: str
    computed: str
    gains: tuple[str, ...]
    winding: tuple[str, ...]
    held: Callable[[Any, Any], ParameterSet]
    rest: Callable[[Any], tuple[Any, Any]] | None = None

    def identify(
        self, data: xr.Dataset, par: ParameterSet, options: LoopOptions, effort: Effort
    ) -> Identified:
        """Estimate the gains and, with that option, the winding.

        The loop runs over the measured demand with a locked rotor, and is fitted to the measured
        current.

        Parameters
        ----------
        data
            Demand and current [A] with the rotor locked or stuck; one or several records.
        par
            Start of the search.
        options, effort
            Unknowns, and the effort of the search.

        Raises
        ------
        ParameterError
            When the demand does not step, or nothing can be estimated.

        Notes
        -----
        The response from demand to current depends only on k_p V/L, k_i V/L and R/L. With all four
        unknown, the least determined one keeps its value, and bywire reports it.
        """
        trials = [self._trial(record, par, options, label) for label, record in split(data).items()]
        return _identified_loop(trials, par, options.names(self.gains, self.winding))

    def _trial(
        self, data: xr.Dataset, par: ParameterSet, options: LoopOptions, label: str
    ) -> Trial:
        require_steps(data, self.demand, self.current, label)
        i = data[self.current].values
        sigma = noise_of_levels(i, data[self.demand].values)
        held = self.held(par, options)
        state, memory = self.rest(held) if self.rest else (None, None)
        beside = trial(
            self.model,
            held,
            data.assign({self.computed: ("time", i)}),
            {self.demand: self.demand},
            {self.computed: sigma},
            state=state,
            memory=memory,
            label=label,
        )
        return _without_lead(beside, data, options.lead)

    def record(self, time: Array, demand: Array, current: Array, label: str) -> xr.Dataset:
        """Return a record of demand and current [A]; ``label``: long name of the current."""
        signals = {
            self.demand: (demand, "A", "current demand"),
            self.current: (current, "A", label),
        }
        return labeled({"time": (time, "s", "time")}, signals)

    def method(self, **declared: Any) -> Method:
        """Return the method that identifies the loop; ``declared``: details from its brake."""
        return Method(
            signals={self.demand: "A", self.current: "A"},
            identify=self.identify,
            unknowns=self.gains,
            several=True,
            **declared,
        )


# --- A winding alone

Amperes = Annotated[float, Signal("A", "motor current", 5.0)]
_SETTLED = 10.0  # time constants of the sensor's filter until the start has no effect
_SUBSTEPS = 4  # per sample, at least
_LONGEST = 5e-6  # substep [s]: 20 us causes an error of 0.04 % in L_m for L_m/R_m = 0.3 ms


class Parameters(ParameterSet):
    """Winding, and the filter in front of the converter."""

    motor: dc_motor.Parameters
    f_aa: Frequency
    """cutoff of the current measurement's filter"""
    T: Duration
    """hold time of an input"""


class Currents(NamedTuple):
    """Current, and current behind the filter."""

    i: Amperes
    i_meas: Annotated[float, Signal("A", "measured current", 5.0)]


class Inputs(NamedTuple):
    """Measured inputs, held between samples."""

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
        """Return the hold time of an input [s]."""
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
    """Return the trial of a record with the winding's model.

    Parameters
    ----------
    motor
        Start of the search.
    data
        Over ``time`` [s], evenly spaced.
    names
        Names of ``v``, ``omega`` and ``i`` in it.
    f_aa
        Cutoff of the current measurement's filter [Hz].
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
        # Voltage is held from sample to sample; the speed continues in between.
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
