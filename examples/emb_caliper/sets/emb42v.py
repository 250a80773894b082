"""A 42 V brake of the same size as the brake of Line, Manzie and Good (2008).

The full text of the paper was not available, only title, abstract and index terms. Of Line, Manzie
and Good (2006), only the abstract and the description of the mechanism were available. Therefore no
number is marked as printed. The commonly quoted numbers for this brake are chosen and marked as
unverified.
"""

from __future__ import annotations

import math

from bywire.authoring import CitedSet, chosen, derived
from emb_caliper.ecu import travel_per_angle
from emb_caliper.parameters import CaliperBrakeParameters, SynchronousBrakeParameters

SOURCE = (
    "C. Line, C. Manzie, M. C. Good, Electromechanical brake modeling and control: from PI to MPC, "
    "IEEE Trans. Control Systems Technology 16(3), 446-457, 2008; mechanism: the same authors, "
    "Robust control of an automotive electromechanical brake, IFAC, 2006"
)
_TOLD = "commonly quoted for the source's actuator, unverified"
_CURVE = "-7.23 x^3 + 33.7 x^2 - 4.97 x kN (x in mm), from its positive root on, unverified"
_MOTOR = "EMB motor in the benchmark of Strathmann and Oehlerking (ARCH 2015)"

_A, _B, _C = -7.23e12, 33.7e9, -4.97e6  # coefficients of the cubic, SI
_PADS = "Maxwell springs of a few percent of the load; no value for this brake is available"
_TOUCH = (-_B + math.sqrt(_B * _B - 4.0 * _A * _C)) / (2.0 * _A)  # its root, where the pads touch

_PLANT = {
    "supply.V_bat": chosen(42.0, "for planned 42 V vehicles; 40 A at 300 rad/s need 41 V"),
    "supply.R_bat": chosen(0.02, "battery and leads of this class"),
    "bridge.D_max": chosen(1.0, "|D| <= 1"),
    "bridge.f_pwm": chosen(20e3, "inaudible; for information only"),
    "motor.R_m": chosen(0.5, _MOTOR),
    "motor.L_m": chosen(1e-3, _MOTOR),
    "motor.K_e": chosen(0.0697, _TOLD),
    "rotor.J": chosen(0.291e-3, _TOLD),
    "rotor.D": chosen(3.95e-4, _TOLD),
    "friction.C": chosen(0.0304, _TOLD),
    "friction.G": chosen(1.17e-5, _TOLD),
    "friction.T_s": chosen(0.0379, _TOLD),
    "friction.omega_s": chosen(2.0, "breakaway vanishes at a few turns per minute"),
    "gear.z_sun_1": chosen(16.0, "30.25 in two equal stages, 0.0263 mm/rad with the screw"),
    "gear.z_ring_1": chosen(72.0, "30.25 in two equal stages, 0.0263 mm/rad with the screw"),
    "gear.z_sun_2": chosen(16.0, "30.25 in two equal stages, 0.0263 mm/rad with the screw"),
    "gear.z_ring_2": chosen(72.0, "30.25 in two equal stages, 0.0263 mm/rad with the screw"),
    "screw.lead": chosen(5e-3, "a ball screw for this load; 0.0263 mm/rad is unverified"),
    "caliper.k_1": derived((3.0 * _A * _TOUCH + 2.0 * _B) * _TOUCH + _C, _CURVE),
    "caliper.k_2": derived(_B + 3.0 * _A * _TOUCH, _CURVE),
    "caliper.k_3": derived(_A, _CURVE),
    "caliper.n_max": chosen(1.3e-3, "about 40 kN; the curve stiffens up to 1.4 mm"),
    "caliper.tau": chosen(1e-4, "small compared with the viscous friction"),
    "caliper.clearance": chosen(3e-4, "0.15 mm on either side of the disc"),
    "hysteresis.law": chosen("off", "the commonly quoted brake has none"),
    "hysteresis.k_1": chosen(4e6, _PADS),
    "hysteresis.k_2": chosen(3e6, _PADS),
    "hysteresis.k_3": chosen(2e6, _PADS),
    "hysteresis.k_4": chosen(1e6, _PADS),
    "hysteresis.W_1": chosen(50.0, _PADS),
    "hysteresis.W_2": chosen(150.0, _PADS),
    "hysteresis.W_3": chosen(300.0, _PADS),
    "hysteresis.W_4": chosen(400.0, _PADS),
    "hysteresis.F_ref": chosen(20e3, "slip forces sum to 4.5 % of the load"),
    "stop.k_stop": chosen(2e7, "stiff compared with the pads, slow compared with the step"),
    "stop.tau_stop": chosen(1e-3, "no noticeable rebound"),
    "stop.x_rest": chosen(-5e-4, "clear of the parking position"),
    "stop.x_end": chosen(4e-3, "worn pads are not modeled"),
    "force.f_F": chosen(1e3, "far above the force loop"),
    "force.gain": chosen(1.0, "calibrated"),
    "encoder.law": chosen("ideal", "a fault adds errors"),
    "encoder.eps_0": chosen(0.0, "calibrated"),
    "encoder.eps_1": chosen(0.0, "centered"),
    "encoder.phi_1": chosen(0.0, "without effect while eps_1 = 0"),
    "encoder.eps_2": chosen(0.0, "centered"),
    "encoder.phi_2": chosen(0.0, "without effect while eps_2 = 0"),
    "encoder.counts": chosen(4096.0, "12 bits"),
    "current.i_low": chosen(-50.0, "above the current limit"),
    "current.i_high": chosen(50.0, "above the current limit"),
    "current_adc.law": chosen("ideal", "the cascade's current sensor is ideal"),
    "current_adc.codes": chosen(4096.0, "12 bits"),
    "current_adc.noise": chosen(0.0, "the cascade's current sensor is ideal"),
    "F_span": chosen(40e3, "above the highest demand"),
    "adc.law": chosen("quantized", "real converters have a finite resolution"),
    "adc.codes": chosen(4096.0, "12 bits"),
    "adc.noise": chosen(0.0, "the experiment decides"),
}

_DESIGN = "tuned on the linear model at 20 kN"
_KNOWN = "identified without error"
_TRIAL = "tuned on simulated strokes with all errors of the brake's properties"
_ESTIMATE = {
    "ecu.feedback": chosen("sensor", "the standard cascade trusts the load cell"),
    "ecu.estimation": chosen("off", "the standard cascade needs no estimate"),
    "ecu.K_t_hat": derived(lambda par: par.motor.K_e, _KNOWN),
    "ecu.estimator.theta_0": derived(
        lambda par: par.caliper.clearance / travel_per_angle(par), _KNOWN
    ),
    "ecu.estimator.s": chosen(1.0, "the curve below is the caliper's"),
    "ecu.estimator.C_hat": derived(lambda par: par.friction.C, _KNOWN),
    "ecu.estimator.G_hat": derived(lambda par: par.friction.G, _KNOWN),
    "ecu.estimator.gamma": derived(travel_per_angle, "gear and screw"),
    "ecu.estimator.J_hat": derived(lambda par: par.rotor.J, _KNOWN),
    "ecu.estimator.D_hat": derived(lambda par: par.rotor.D, _KNOWN),
    "ecu.estimator.k_1": derived(lambda par: par.caliper.k_1, _KNOWN),
    "ecu.estimator.k_2": derived(lambda par: par.caliper.k_2, _KNOWN),
    "ecu.estimator.k_3": derived(lambda par: par.caliper.k_3, _KNOWN),
    "ecu.estimator.n_max": derived(lambda par: par.caliper.n_max, "end of the measured curve"),
    "ecu.estimator.k": chosen(188.5, "two poles at 30 Hz, the delay of one pole at 15 Hz"),
    "ecu.estimator.play": chosen(3.07e-3, "two counts of 12 bits"),
    "ecu.estimator.t_rest": chosen(5e-3, "less than the filter's delay"),
    "ecu.estimator.omega_min": chosen(3.0, "above the speed of the breakaway friction"),
    "ecu.estimator.spread_s": chosen(0.1, _TRIAL),
    "ecu.estimator.spread_friction": chosen(0.2, _TRIAL),
    "ecu.estimator.spread_J": chosen(0.02, _TRIAL),
    "ecu.estimator.sigma_T": chosen(3e-3, "current noise of 0.1 A, averaged and filtered"),
    "ecu.estimator.tau": chosen(0.25, _TRIAL),
    "ecu.training.law": chosen("strokes", "without effect while the estimate is off"),
    "ecu.training.spread_n": chosen(5e-4, "wear and warm pads"),
    "ecu.training.spread_s": chosen(0.15, "pads of different makes"),
    "ecu.training.spread_C": chosen(0.3, "grease, cold and warm"),
    "ecu.training.spread_G": chosen(0.3, "grease, cold and warm"),
    "ecu.training.first": chosen(0.1, "the values above are identified"),
    "ecu.training.kept": chosen(0.1, "changes from stroke to stroke are smaller"),
    "ecu.training.sigma_T": chosen(3e-3, "current noise of 0.1 A, averaged and filtered"),
    "ecu.training.memory": chosen(0.998, _TRIAL),
    "ecu.training.F_contact": chosen(5e3, "the curve is soft below"),
    "ecu.training.F_stroke": chosen(7.5e3, "30 % of full scale"),
    "ecu.monitor.F_apart": chosen(2.5e3, "10 % of full scale, several times a trained error"),
    "ecu.monitor.t_apart": chosen(10e-3, "ten samples"),
    "ecu.monitor.F_close": chosen(1e3, "hysteresis"),
    "ecu.monitor.F_loaded": chosen(5e3, "a lost sensor is obvious there"),
    "ecu.monitor.t_close": chosen(0.5, "longer than a disturbance"),
    "ecu.monitor.spread": chosen(0.5, "more than the friction changes"),
    "ecu.monitor.T_margin": chosen(0.05, "lag of the filter in fast steps"),
}
_ECU = _ESTIMATE | {
    "ecu.T_force": chosen(1e-3, "common rate of chassis controllers"),
    "ecu.T_current": chosen(2e-4, "common rate of current control; whole substeps of 20 us"),
    "ecu.F_on": chosen(200.0, "above the resolution of the force sensor"),
    "ecu.k_park": chosen(30.0, "parks within 0.2 s without overshoot"),
    "ecu.scheduling": chosen("off", "the standard cascade has fixed gains"),
    "ecu.load": chosen("off", "the standard cascade has no feed-forward"),
    "ecu.force.k_p": chosen(0.04, _DESIGN),
    "ecu.force.k_i": chosen(0.04, _DESIGN),
    "ecu.force.omega_max": chosen(300.0, _TOLD),
    "ecu.speed.k_p": chosen(0.8, "30 Hz: k_p = J w / K_e"),
    "ecu.speed.k_i": chosen(30.0, "a fifth of the crossover"),
    "ecu.speed.i_max": chosen(40.0, _TOLD),
    "ecu.current.k_p": chosen(0.04, "about 270 Hz: k_p = w L / V"),
    "ecu.current.k_i": chosen(20.0, "zero at the winding's pole"),
    "ecu.current.T_t": chosen(2e-3, "time constant of the winding"),
    "ecu.current.D_max": chosen(1.0, "|D| <= 1"),
    "drive": chosen("force", "the experiment decides"),
}

_MODIFIED = {
    "ecu.scheduling": chosen("stiffness", "the abstract mentions gain scheduling"),
    "ecu.load": chosen("fed-forward", "load part of the feedback linearization in the abstract"),
    "ecu.force.k_p": chosen(0.2, "the product of gain and stiffness is 0.2 k_1 everywhere"),
    "ecu.force.k_i": chosen(0.2, "same as k_p"),
}

# A synchronous motor that makes the same torque per current, with the same copper loss.
_K_T = 0.0697  # torque per amplitude [N*m/A], as the DC motor's
_SERVO = "servo motor Teknic M-2310P (4 pole pairs, 0.36 ohm, 0.2 mH)"
_SYNCHRONOUS = {
    "inverter.law": chosen("ideal", "averaged; a fault adds dead time"),
    "inverter.f_s": chosen(10e3, "one carrier period per sample"),
    "inverter.t_d": chosen(1e-6, "MOSFETs of this class"),
    "inverter.V_f": chosen(0.0, "MOSFETs conduct in both directions"),
    "inverter.i_th": chosen(0.05, "2 C_oss V_dc / t_d with 0.6 nF"),
    "inverter.gates": chosen(1.0, "a fault switches them off"),
    "inverter.i_off": chosen(1.0, "half of V_dc h / L for a step of 10 us"),
    "motor.law": chosen("linear", "no map available"),
    "motor.map.i_d": chosen((), "no map available"),
    "motor.map.i_q": chosen((), "no map available"),
    "motor.map.psi_d": chosen((), "no map available"),
    "motor.map.psi_q": chosen((), "no map available"),
    "motor.p": chosen(4.0, _SERVO),
    "motor.R": derived(0.5 / 1.5, "copper loss of the DC motor at the same torque, 1.5 R = R_m"),
    "motor.L_d": derived(0.5 / 1.5 * 0.2e-3 / 0.36, f"time constant L/R of the {_SERVO}"),
    "motor.L_q": derived(lambda par: par.motor.L_d, "surface magnets"),
    "motor.psi": derived(
        lambda par: _K_T / (1.5 * par.motor.p), "torque constant of the DC motor, 1.5 p psi = K_e"
    ),
    "motor.iron": chosen("off", "the drive train's viscous friction includes it"),
    "motor.c_h": chosen(0.0, "no value available"),
    "motor.c_e": chosen(0.0, "no value available"),
}
_FIELD_ORIENTED = {
    "ecu.K_t_hat": derived(lambda par: 1.5 * par.motor.p * par.motor.psi, _KNOWN),
    "ecu.T_current": chosen(1e-4, "common rate of field-oriented control; five steps of 20 us"),
    "ecu.current.omega_c": derived(
        lambda par: 1.0 / (3.0 * par.ecu.T_current), "phase margin of 61.4 degrees"
    ),
    "ecu.current.p": derived(lambda par: par.motor.p, _KNOWN),
    "ecu.current.R_a": chosen(0.0, "the speed control rejects disturbances"),
    "ecu.current.R_hat": derived(lambda par: par.motor.R, _KNOWN),
    "ecu.current.L_d_hat": derived(lambda par: par.motor.L_d, _KNOWN),
    "ecu.current.L_q_hat": derived(lambda par: par.motor.L_q, _KNOWN),
    "ecu.current.psi_hat": derived(lambda par: par.motor.psi, _KNOWN),
    "ecu.current.lead": chosen(1.5, "a delay of one sample, and half a sample of holding"),
    "ecu.current.i_max": derived(lambda par: par.ecu.speed.i_max, "limit of the speed control"),
    "ecu.current.voltage": chosen("circle", "sinusoidal voltages"),
    "ecu.current.k_fw": chosen(0.0, "off: the back EMF stays below the voltage limit"),
    "ecu.current.reserve": chosen(0.95, "without effect while k_fw = 0"),
}


_OF_DC_MOTOR = "bridge.", "motor.", "ecu.current."
_ANY_MOTOR = {k: v for k, v in (_PLANT | _ECU).items() if not k.startswith(_OF_DC_MOTOR)}

CASCADE = CitedSet(
    name="emb42v",
    assembly="emb-caliper",
    source=SOURCE,
    summary="42 V electro-mechanical caliper with a standard cascade of PI controllers",
    parameter_class=CaliperBrakeParameters,
    values=_PLANT | _ECU,
)
MODIFIED = CitedSet(
    name="emb42v-modified",
    assembly="emb-caliper",
    source=SOURCE,
    summary="the same brake with gains that follow the stiffness, and load feed-forward",
    parameter_class=CaliperBrakeParameters,
    values=_PLANT | _ECU | _MODIFIED,
)
_SENSORS = {
    "encoder.law": chosen("real", "rounded to whole counts"),
    "current_adc.law": chosen("quantized", "real converters have a finite resolution"),
    "current_adc.noise": chosen(1e-3, "0.1 A of 100 A"),
    "ecu.estimation": chosen("on", "for the feedback"),
    "ecu.feedback": chosen("fallback", "the estimate replaces a lost load cell"),
}
ESTIMATED = CitedSet(
    name="emb42v-fallback",
    assembly="emb-caliper",
    source=SOURCE,
    summary="the same brake with real sensors and an estimate that replaces a lost load cell",
    parameter_class=CaliperBrakeParameters,
    values=_PLANT | _ECU | _SENSORS,
)
SYNCHRONOUS = CitedSet(
    name="emb42v-pmsm",
    assembly="emb-caliper-pmsm",
    source=SOURCE,
    summary="the same brake with a synchronous motor and field-oriented control",
    parameter_class=SynchronousBrakeParameters,
    values=_ANY_MOTOR | _SYNCHRONOUS | _FIELD_ORIENTED,
)
ESTIMATED_SYNCHRONOUS = CitedSet(
    name="emb42v-pmsm-fallback",
    assembly="emb-caliper-pmsm",
    source=SOURCE,
    summary="the same synchronous brake with real sensors and an estimate of the clamp force",
    parameter_class=SynchronousBrakeParameters,
    values=_ANY_MOTOR | _SYNCHRONOUS | _FIELD_ORIENTED | _SENSORS,
)
