"""The ECU's estimate of the clamp force, its training, and the force that control uses.

It is the same for every motor: its inputs are angle and current as the ECU measures them.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.authoring import Signal, joined
from bywire.control import clamp_force_estimator as estimator
from bywire.control import clamp_force_training as training
from emb_caliper.laws import force_monitor


class Results(NamedTuple):
    """Results of each tick."""

    i_sum: Annotated[float, Signal("A", "sum of the current's samples", 50.0)]
    F_used: Annotated[float, Signal("N", "clamp force for control", 1e4)]
    T_load: Annotated[float, Signal("N*m", "estimated load torque", 0.5)]
    F_balance: Annotated[float, Signal("N", "clamp force of the torque balance", 1e4)]
    balance_valid: Annotated[float, Signal("1", "the torque balance is valid")]


Memory: Any = joined(
    __name__, "Memory", Results, force_monitor.State, estimator.State, training.State
)
"""memory of estimator, training and monitor"""


def estimated(theta: float, i: float, m: Any, par: Any) -> Any:
    """Advance the estimate, and its training, by one sample.

    It uses the mean of the current since the last sample (trapezoidal rule), because the current
    changes quickly right after each sample of the speed control.

    Parameters
    ----------
    theta, i
        Measured motor angle [rad] and current [A].
    """
    ecu = par.ecu
    mean = (m.i_sum + 0.5 * i) * (ecu.T_current / ecu.T_force)
    m = m._replace(i_sum=-0.5 * i)  # current control adds this sample in full
    learned = _part(training.State, m)
    held = training.brake(learned, ecu.estimator)
    state, out = estimator.output(
        _part(estimator.State, m),
        estimator.Input(theta, ecu.K_t_hat * mean),
        held,
        ecu.T_force,
        ecu.estimator,
    )
    m = m._replace(
        **state._asdict(), T_load=out.T_L, F_balance=out.F_balance, balance_valid=out.valid
    )
    if ecu.training.law == "off":
        return m._replace(theta_0_hat=held.theta_0, s_hat=held.s, C_hat=held.C, G_hat=held.G)
    learned = training.output(
        learned,
        training.Input(theta, state.motion, out.omega, out.T_L, out.T_J, out.valid),
        ecu.T_force,
        ecu.estimator,
        ecu.training,
    )
    return m._replace(**learned._asdict())


def summed(i: float, m: Any, par: Any) -> Any:
    """Return the memory with a sample of the current."""
    return m._replace(i_sum=m.i_sum + i) if par.ecu.estimation == "on" else m


def fed_back(m: Any, par: Any) -> Any:
    """Return the memory with the clamp force that control uses."""
    ecu = par.ecu
    if ecu.feedback == "sensor":
        return m._replace(F_used=m.F_meas)
    if ecu.feedback == "estimate":
        return m._replace(F_used=m.F_hat)
    state, out = force_monitor.output(
        _part(force_monitor.State, m),
        force_monitor.Input(m.F_meas, m.F_hat, m.T_load, m.started),
        ecu.T_force,
        ecu.estimator,
        ecu.monitor,
    )
    return m._replace(**state._asdict(), F_used=out.F)


def _part(kind: Any, m: Any) -> Any:
    """Return a law's state from the memory."""
    return kind(*[getattr(m, name) for name in kind._fields])
