r"""Training of a clamp force estimate by the strokes of the brake.

While the shaft turns, an extended Kalman filter fits contact angle, scale of the stiffness curve,
and friction to the filtered load torque of `clamp_force_estimator`,

.. math:: L[T_L] = L[\gamma F_1 + \mathrm{sgn}(\omega) (C + G F_1)], \quad
    F_1 = s f(\gamma (\theta - \theta_0))

The regressors go through the same filter L as the torque, so neither its lag nor a reversal
matters. While the brake only applies, scale and friction act alike: the torque determines
:math:`s (\gamma + G)`, and only the release separates them. Therefore, the estimate uses a fit of
all four properties after a stroke that exceeds a force and returns to zero. The contact angle and
the friction without load follow earlier, when an application passes a low force.

Each stroke starts with the uncertainty of the parameters. After the first complete stroke, this
uncertainty decreases by ``kept``, so that later strokes follow wear and temperature.

The fit has corners where the pads touch, and where a deviation becomes too large to be noise.

References
----------
S. Saric, A. Bab-Hadiashar, R. Hoseinnezhad, A sensor fusion approach to estimate clamp force, 2007
(abstract): training of the friction. G. Park, S. B. Choi, Proc. IMechE D 232(14), 2018 (abstract):
contact angle and stiffness.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.control import clamp_force_estimator as estimator
from bywire.control.clamp_force_estimator import Brake
from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Fraction, Length, Unit
from bywire.core.signals import Signal

ForceLevel = Annotated[float, Unit("N", 5e3), Field(gt=0, allow_inf_nan=False)]
TorqueError = Annotated[float, Unit("N*m", 3e-3), Field(gt=0, allow_inf_nan=False)]
Spread = Annotated[float, Unit("1", 0.1), Field(ge=0, le=1, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Torques = Annotated[float, Signal("N*m", "sensitivity of the load torque", 0.1)]
Shares = Annotated[float, Signal("1", "covariance, relative to the uncertainties", 0.1)]

OUTLIER = 3.0
"""standard deviations above which a deviation of the torque counts less"""
CONTACT = 5.0
"""standard deviations of the torque above which the pads touch earlier than expected"""
DOUBT = 0.3
"""uncertainty of a contact angle that the load torque shows, as a part of the way since contact"""
SMALLEST = 1e-6
"""smallest divisor, relative to the usual magnitude"""
WIDEST = 2.0
"""the fitted scale stays within this factor of its start, and each friction below 1 plus it"""


class Parameters(ParameterSet):
    """Uncertainties of an unknown brake, and the forces that a stroke must reach.

    ``law``: with ``"off"``, the estimate uses the properties of its parameters.
    """

    law: Literal["off", "strokes"]
    """whether strokes train the estimate"""
    spread_n: Length
    """uncertainty of the contact, as a travel"""
    spread_s: Spread
    """relative uncertainty of the stiffness scale"""
    spread_C: Spread
    """relative uncertainty of the friction without load"""
    spread_G: Spread
    """relative uncertainty of the friction per force"""
    first: Fraction
    """part of these uncertainties before the first stroke; 1 if nothing is identified"""
    kept: Fraction
    """part of these uncertainties that remains after a complete stroke"""
    sigma_T: TorqueError
    """uncertainty of a sample of the load torque"""
    memory: Fraction
    """weight of a sample's information one sample later"""
    F_contact: ForceLevel
    """force at which an application has determined the contact angle"""
    F_stroke: ForceLevel
    """force that a stroke must exceed to determine scale and friction"""


class State(NamedTuple):
    """Properties in use, fit of the present stroke, its covariance, and filtered sensitivities.

    Contact angle, scale and frictions have the letters t, s, C and G.
    """

    strokes: Annotated[float, Signal("1", "number of complete strokes")]
    theta_0_hat: Annotated[float, Signal("rad", "trained contact angle", 10.0)]
    s_hat: Annotated[float, Signal("1", "trained scale of the stiffness curve", 1.0)]
    C_hat: Annotated[float, Signal("N*m", "trained friction torque without load", 0.03)]
    G_hat: Annotated[float, Signal("N*m/N", "trained friction torque per force", 1e-5)]
    fit_theta_0: Annotated[float, Signal("rad", "contact angle of the present stroke", 10.0)]
    fit_s: Annotated[float, Signal("1", "scale of the present stroke", 1.0)]
    fit_C: Annotated[float, Signal("N*m", "friction of the present stroke", 0.03)]
    fit_G: Annotated[float, Signal("N*m/N", "friction per force of the stroke", 1e-5)]
    F_peak: Annotated[float, Signal("N", "maximum force of the present stroke", 1e4)]
    contact_found: Annotated[float, Signal("1", "the stroke has determined the contact angle")]
    P_tt: Shares
    P_ts: Shares
    P_tC: Shares
    P_tG: Shares
    P_ss: Shares
    P_sC: Shares
    P_sG: Shares
    P_CC: Shares
    P_CG: Shares
    P_GG: Shares
    h_t_1: Annotated[float, Signal("N*m/rad", "contact angle, first pole", 0.01)]
    h_t_2: Annotated[float, Signal("N*m/rad", "contact angle, second pole", 0.01)]
    h_s_1: Annotated[float, Signal("N*m", "scale, first pole", 0.5)]
    h_s_2: Annotated[float, Signal("N*m", "scale, second pole", 0.5)]
    h_C_1: Annotated[float, Signal("1", "friction without load, first pole", 1.0)]
    h_C_2: Annotated[float, Signal("1", "friction without load, second pole", 1.0)]
    h_G_1: Annotated[float, Signal("N", "friction per force, first pole", 1e4)]
    h_G_2: Annotated[float, Signal("N", "friction per force, second pole", 1e4)]


class Input(NamedTuple):
    """Angle, direction of motion, and torques of the estimator."""

    theta: Annotated[float, Signal("rad", "motor angle", 30.0)]
    way: Annotated[float, Signal("1", "direction of motion: 1, -1, or 0 at rest", 1.0)]
    omega: Annotated[float, Signal("rad/s", "filtered motor speed", 100.0)]
    T_L: Annotated[float, Signal("N*m", "filtered load torque", 0.5)]
    T_J: Annotated[float, Signal("N*m", "filtered accelerating torque", 0.5)]
    valid: Annotated[float, Signal("1", "the torque balance is valid")]


def brake(x: State, of: estimator.Parameters) -> Brake:
    """Return the properties in use; before the first sample, those of the parameters."""
    first, old = estimator.brake(of), x.s_hat > 0.0
    return Brake(
        theta_0=ops.where(old, x.theta_0_hat, first.theta_0),
        s=ops.where(old, x.s_hat, first.s),
        C=ops.where(old, x.C_hat, first.C),
        G=ops.where(old, x.G_hat, first.G),
    )


def output(x: State, u: Input, T: SampleTime, of: estimator.Parameters, par: Parameters) -> State:
    r"""Advance the training by one sample.

    With the deviation e of the filtered load torque, its sensitivities h to the properties, each
    multiplied by the property's uncertainty, and their covariance P (initially the unit matrix),

    .. math::
        S = h^T P h + R, \quad p \leftarrow p + P h\, e / S, \quad
        P \leftarrow (P - P h h^T P / S) / \lambda, \quad
        R = \frac{2}{k T} \left(\sigma_T^2 + (\sigma_J T_J)^2\right)

    R takes into account that the filter correlates the noise of 2/(k T) samples. An outlier
    increases R, so that it counts only in proportion to its size. If the load torque increases
    before the fit expects contact, only the contact angle follows.

    Notes
    -----
    Each stroke begins with a contact angle that is later than expected by its uncertainty. Torque
    then shows the contact, whereas a fit that begins too early expects torque in free travel, and
    has lost the softest part of the curve until it has moved.

    If the fit changes, the filtered sensitivities change to first order, as if the fit had been the
    same within the filter's memory.
    """
    x = _started(x, brake(x, of), of, par)
    x = _filtered(x, u, T, of)
    x = _touched(x, u, of, par)
    x = _corrected(x, u, T, of, par)
    return _ended(x, u, of, par)


def _started(x: State, held: Brake, of: estimator.Parameters, par: Parameters) -> State:
    """Return the state; before the first sample, the fit has the properties in use."""
    old, first = x.s_hat > 0.0, par.first * par.first
    latest = par.first * par.spread_n / of.gamma
    return x._replace(
        theta_0_hat=held.theta_0,
        s_hat=held.s,
        C_hat=held.C,
        G_hat=held.G,
        fit_theta_0=ops.where(old, x.fit_theta_0, held.theta_0 + latest),
        fit_s=ops.where(old, x.fit_s, held.s),
        fit_C=ops.where(old, x.fit_C, held.C),
        fit_G=ops.where(old, x.fit_G, held.G),
        P_tt=ops.where(old, x.P_tt, first),
        P_ss=ops.where(old, x.P_ss, first),
        P_CC=ops.where(old, x.P_CC, first),
        P_GG=ops.where(old, x.P_GG, first),
    )


def _filtered(x: State, u: Input, T: SampleTime, of: estimator.Parameters) -> State:
    """Return the state with the filters of the sensitivities one sample later.

    Like the second pole of the torque, each second pole reads the last value of the first.
    """
    a = estimator.weight(T, of)
    n = of.gamma * (u.theta - x.fit_theta_0)
    curve = estimator.force(n, of)
    slope = ops.where(n > 0.0, estimator.slope(n, of), 0.0)
    per_force = of.gamma + u.way * x.fit_G
    h_t = -per_force * x.fit_s * of.gamma * slope
    return x._replace(
        h_t_1=x.h_t_1 + a * (h_t - x.h_t_1),
        h_t_2=x.h_t_2 + a * (x.h_t_1 - x.h_t_2),
        h_s_1=x.h_s_1 + a * (per_force * curve - x.h_s_1),
        h_s_2=x.h_s_2 + a * (x.h_s_1 - x.h_s_2),
        h_C_1=x.h_C_1 + a * (u.way - x.h_C_1),
        h_C_2=x.h_C_2 + a * (x.h_C_1 - x.h_C_2),
        h_G_1=x.h_G_1 + a * (u.way * x.fit_s * curve - x.h_G_1),
        h_G_2=x.h_G_2 + a * (x.h_G_1 - x.h_G_2),
    )


def _expected(x: State) -> Torques:
    """Return the filtered load torque of the fit."""
    return x.fit_s * x.h_s_2 + x.fit_C * x.h_C_2


def _noise(
    u: Input, of: estimator.Parameters, par: Parameters
) -> Annotated[float, Signal("N**2*m**2", "variance of the load torque", 1e-4)]:
    """Return the variance of a sample of the load torque."""
    inertial = of.spread_J * u.T_J
    return par.sigma_T * par.sigma_T + inertial * inertial


def _touched(x: State, u: Input, of: estimator.Parameters, par: Parameters) -> State:
    r"""Return the state with a new contact angle if the pads touch before the fit expects it.

    Right after contact, the filtered load torque is that of an angle 2/k ago, so that

    .. math:: \theta_0 = \theta - \frac{2 \omega}{k}
        - \frac{L[T_L] - C}{(\gamma + G) s \gamma k_1}
    """
    per_force = of.gamma + x.fit_G
    scale = ops.fmax(x.fit_s, SMALLEST)
    slope = per_force * scale * of.gamma * of.k_1
    doubt = CONTACT * CONTACT * _noise(u, of, par)
    fresh = ops.where(-x.h_t_2 < 0.5 * slope, u.valid, 0.0)
    pressing = ops.where(u.way > 0.5, fresh, 0.0)
    excess = ops.fmax(u.T_L - _expected(x), 0.0)
    touches = ops.where(excess * excess > doubt, pressing, 0.0) > 0.5
    e = u.T_L - x.fit_C * x.h_C_2
    back = 2.0 * u.omega / of.k + e / slope
    w_t, _, _ = _uncertainties(of, par)
    spread = DOUBT * back / w_t
    force = e / per_force
    return x._replace(
        fit_theta_0=ops.where(touches, u.theta - back, x.fit_theta_0),
        h_t_1=ops.where(touches, -slope, x.h_t_1),
        h_t_2=ops.where(touches, -slope, x.h_t_2),
        h_s_1=ops.where(touches, e / scale, x.h_s_1),
        h_s_2=ops.where(touches, e / scale, x.h_s_2),
        h_G_1=ops.where(touches, force, x.h_G_1),
        h_G_2=ops.where(touches, force, x.h_G_2),
        P_tt=ops.where(touches, spread * spread, x.P_tt),
        P_ts=ops.where(touches, 0.0, x.P_ts),
        P_tC=ops.where(touches, 0.0, x.P_tC),
        P_tG=ops.where(touches, 0.0, x.P_tG),
    )


def _corrected(
    x: State, u: Input, T: SampleTime, of: estimator.Parameters, par: Parameters
) -> State:
    """Return the state with a fit that takes the sample into account.

    Right after contact, the sensitivity to the contact angle lags, so the fit waits.
    """
    e = u.T_L - _expected(x)
    # Sensitivities relative to the uncertainties.
    w_t, w_C, w_G = _uncertainties(of, par)
    h_t, h_s, h_C, h_G = w_t * x.h_t_2, par.spread_s * x.h_s_2, w_C * x.h_C_2, w_G * x.h_G_2
    v_t = x.P_tt * h_t + x.P_ts * h_s + x.P_tC * h_C + x.P_tG * h_G
    v_s = x.P_ts * h_t + x.P_ss * h_s + x.P_sC * h_C + x.P_sG * h_G
    v_C = x.P_tC * h_t + x.P_sC * h_s + x.P_CC * h_C + x.P_CG * h_G
    v_G = x.P_tG * h_t + x.P_sG * h_s + x.P_CG * h_C + x.P_GG * h_G
    R = 2.0 / (of.k * T) * _noise(u, of, par)
    known = h_t * v_t + h_s * v_s + h_C * v_C + h_G * v_G
    S = known + R * ops.fmax(e * e / (OUTLIER * OUTLIER * (known + R)), 1.0)
    slope = (of.gamma + u.way * x.fit_G) * x.fit_s * of.gamma * of.k_1
    fresh = ops.where(-x.h_t_2 < 0.5 * slope, 1.0, 0.0)
    waits = ops.where(of.gamma * (u.theta - x.fit_theta_0) > 0.0, fresh, 0.0)
    counts = u.valid * (1.0 - waits) > 0.5
    gain = ops.where(counts, e / S, 0.0)
    x = _moved(
        x,
        Brake(
            theta_0=x.fit_theta_0 + w_t * v_t * gain,
            s=ops.clip(x.fit_s + par.spread_s * v_s * gain, of.s / WIDEST, of.s * WIDEST),
            C=ops.clip(x.fit_C + w_C * v_C * gain, 0.0, (1.0 + WIDEST) * of.C_hat),
            G=ops.clip(x.fit_G + w_G * v_G * gain, 0.0, (1.0 + WIDEST) * of.G_hat),
        ),
    )
    q = ops.where(counts, 1.0 / S, 0.0)
    forgets = x.P_tt + x.P_ss + x.P_CC + x.P_GG < 4.0
    r = ops.where(counts, ops.where(forgets, 1.0 / par.memory, 1.0), 1.0)
    return x._replace(
        P_tt=r * (x.P_tt - q * v_t * v_t),
        P_ts=r * (x.P_ts - q * v_t * v_s),
        P_tC=r * (x.P_tC - q * v_t * v_C),
        P_tG=r * (x.P_tG - q * v_t * v_G),
        P_ss=r * (x.P_ss - q * v_s * v_s),
        P_sC=r * (x.P_sC - q * v_s * v_C),
        P_sG=r * (x.P_sG - q * v_s * v_G),
        P_CC=r * (x.P_CC - q * v_C * v_C),
        P_CG=r * (x.P_CG - q * v_C * v_G),
        P_GG=r * (x.P_GG - q * v_G * v_G),
    )


def _moved(x: State, fit: Brake) -> State:
    """Return the state with another fit, and with the sensitivities that follow from it."""
    scale = ops.fmax(x.fit_s, SMALLEST)
    d_t, d_G = (fit.theta_0 - x.fit_theta_0) / scale, (fit.G - x.fit_G) / scale
    return x._replace(
        fit_theta_0=fit.theta_0,
        fit_s=fit.s,
        fit_C=fit.C,
        fit_G=fit.G,
        h_s_1=x.h_s_1 + d_t * x.h_t_1 + d_G * x.h_G_1,
        h_s_2=x.h_s_2 + d_t * x.h_t_2 + d_G * x.h_G_2,
    )


def _ended(x: State, u: Input, of: estimator.Parameters, par: Parameters) -> State:
    """Return the state with the properties that the stroke has determined.

    When the pads leave the disc, the next stroke begins with the properties in use.
    """
    F = x.fit_s * estimator.force(of.gamma * (u.theta - x.fit_theta_0), of)
    peak = ops.fmax(x.F_peak, F)
    pressing = ops.where(u.way > 0.5, ops.where(par.F_contact < F, 1.0, 0.0), 0.0)
    found = pressing * (1.0 - x.contact_found) > 0.5
    touched = ops.fmax(pressing, x.contact_found)
    ended = ops.where(F > 0.0, 0.0, touched) > 0.5
    complete = ops.where(ended, ops.where(peak > par.F_stroke, 1.0, 0.0), 0.0) > 0.5
    contact = _contact(x, of, par)
    theta_0 = ops.where(complete, x.fit_theta_0, x.theta_0_hat)
    theta_0 = ops.where(found, contact.theta_0, theta_0)
    C = ops.where(found, contact.C, ops.where(complete, x.fit_C, x.C_hat))
    s, G = ops.where(complete, x.fit_s, x.s_hat), ops.where(complete, x.fit_G, x.G_hat)
    trained = x.strokes + ops.where(complete, 1.0, 0.0)
    kept = ops.where(trained > 0.5, par.kept, par.first)
    first, latest = kept * kept, kept * par.spread_n / of.gamma
    return x._replace(
        strokes=trained,
        theta_0_hat=theta_0,
        s_hat=s,
        C_hat=C,
        G_hat=G,
        fit_theta_0=ops.where(ended, theta_0 + latest, x.fit_theta_0),
        fit_s=ops.where(ended, s, x.fit_s),
        fit_C=ops.where(ended, C, x.fit_C),
        fit_G=ops.where(ended, G, x.fit_G),
        F_peak=ops.where(ended, 0.0, peak),
        contact_found=ops.where(ended, 0.0, touched),
        P_tt=ops.where(ended, first, x.P_tt),
        P_ts=ops.where(ended, 0.0, x.P_ts),
        P_tC=ops.where(ended, 0.0, x.P_tC),
        P_tG=ops.where(ended, 0.0, x.P_tG),
        P_ss=ops.where(ended, first, x.P_ss),
        P_sC=ops.where(ended, 0.0, x.P_sC),
        P_sG=ops.where(ended, 0.0, x.P_sG),
        P_CC=ops.where(ended, first, x.P_CC),
        P_CG=ops.where(ended, 0.0, x.P_CG),
        P_GG=ops.where(ended, first, x.P_GG),
    )


def _contact(x: State, of: estimator.Parameters, par: Parameters) -> Brake:
    """Return contact angle and friction without load if scale and friction per force are in use.

    This is the fit's conditional mean: the fit of two properties to the same samples.
    """
    w_t, w_C, w_G = _uncertainties(of, par)
    w_s = par.spread_s
    d_s = (x.s_hat - x.fit_s) / ops.fmax(w_s, SMALLEST)
    d_G = (x.G_hat - x.fit_G) / ops.fmax(w_G, SMALLEST * of.gamma)
    both = ops.fmax(x.P_ss * x.P_GG - x.P_sG * x.P_sG, SMALLEST)
    by_s, by_G = x.P_GG * d_s - x.P_sG * d_G, x.P_ss * d_G - x.P_sG * d_s
    return Brake(
        theta_0=x.fit_theta_0 + w_t * (x.P_ts * by_s + x.P_tG * by_G) / both,
        s=x.s_hat,
        C=ops.fmax(x.fit_C + w_C * (x.P_sC * by_s + x.P_CG * by_G) / both, 0.0),
        G=x.G_hat,
    )


def _uncertainties(
    of: estimator.Parameters, par: Parameters
) -> tuple[
    Annotated[float, Signal("rad", "uncertainty of the contact angle", 10.0)],
    Annotated[float, Signal("N*m", "uncertainty of the friction without load", 0.01)],
    Annotated[float, Signal("N*m/N", "uncertainty of the friction per force", 1e-6)],
]:
    """Return the uncertainties of contact angle and friction before the first stroke."""
    return par.spread_n / of.gamma, par.spread_C * of.C_hat, par.spread_G * of.G_hat
