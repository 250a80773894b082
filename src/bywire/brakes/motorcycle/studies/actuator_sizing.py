"""Sizing of the motorcycle actuator: gear ratio and motor power for bandwidth and pressure.

The pressure is a specified function of time. Flow, travel, torque, current and voltage follow from
the plant's equations without simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from bywire.bench.experiment import Case, as_run
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.recording import record
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.experiments import hard_braking
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import highest_pressure, travel_at
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Frequency, GearRatio, Pressure, Unit
from bywire.core.typing import Array, Progress
from bywire.data.labeled import labeled
from bywire.plant import ball_screw_gear, brake_fluid, caliper, master_cylinder, pipeline
from bywire.plant import seal_friction as seal
from bywire.simulation.run import simulate
from bywire.synthesis.study import Cut, Findings, Map, Mark, Study, edge_warnings, require_ranges

if TYPE_CHECKING:
    import xarray as xr

Par = MotorcycleParameters

_POINTS = 721
_DOUBLE_POLE = math.sqrt(math.sqrt(2.0) - 1.0)  # -3 dB frequency of 1/(1+s)^2, rad/s


@dataclass(frozen=True)
class Course:
    """A demanded pressure p_mc, its derivatives, and the caliper pressure, shape (n,) each.

    ``t``: times [s]; ``p``, ``rate``, ``bend``: pressure [Pa] and its first and second derivatives;
    ``p_pd``: caliper pressure [Pa]; ``middle``: pressure [Pa] at which the compliances are
    evaluated.
    """

    t: Array
    p: Array
    rate: Array
    bend: Array
    p_pd: Array
    middle: float


@dataclass(frozen=True)
class Motion:
    """Motion of the motor, shape (n,) each, SI.

    ``omega``: speed [rad/s]; ``torque``: electromagnetic torque [N m]; ``inertia``: part of the
    torque that accelerates rotor and piston [N m]; ``current``, ``voltage``: current [A] and
    voltage [V] of the winding, without its inductance; ``available``: voltage that the bridge can
    supply at this current [V].
    """

    omega: Array
    torque: Array
    inertia: Array
    current: Array
    voltage: Array
    available: Array

    @property
    def mechanical(self) -> Array:
        """Mechanical power [W]."""
        return self.torque * self.omega

    @property
    def electrical(self) -> Array:
        """Electrical power at the motor [W]: copper loss and mechanical power."""
        return self.voltage * self.current


def sine(par: Par, top: float, amplitude: float, f: float) -> Course:
    """Return one period of a sine with a frequency [Hz], whose crest is at ``top`` [Pa]."""
    middle, w = top - amplitude, 2.0 * math.pi * f
    t = np.linspace(0.0, 1.0 / f, _POINTS)
    lagging = amplitude * np.exp(1j * w * t) / (1.0 + 1j * w * _lag(par, middle))
    return Course(
        t=t,
        p=middle + amplitude * np.sin(w * t),
        rate=amplitude * w * np.cos(w * t),
        bend=-amplitude * w * w * np.sin(w * t),
        p_pd=middle + lagging.imag,
        middle=middle,
    )


def step(par: Par, p_from: float, p_to: float, bandwidth: float) -> Course:
    r"""Return the response of a double pole with a bandwidth [Hz] to a pressure step [Pa].

    .. math:: p = p_0 + \Delta (1 - (1 + w t) e^{-w t}), \quad w = 2 \pi f / \sqrt{\sqrt 2 - 1}
    """
    middle, height = 0.5 * (p_from + p_to), p_to - p_from
    w, a = 2.0 * math.pi * bandwidth / _DOUBLE_POLE, 1.0 / _lag(par, middle)
    # The closed form divides by zero for a triple pole: keep lag and double pole apart.
    w = w if abs(w / a - 1.0) > 1e-6 else w * (1.0 + 1e-6)
    t = np.linspace(0.0, 10.0 / w, _POINTS)
    slow, fast = np.exp(-w * t), np.exp(-a * t)
    A, C = -(w * w) / (w - a) ** 2, -w * a / (a - w)
    return Course(
        t=t,
        p=p_from + height * (1.0 - (1.0 + w * t) * slow),
        rate=height * w * w * t * slow,
        bend=height * w * w * (1.0 - w * t) * slow,
        p_pd=p_from + height * (1.0 + A * fast + (C * t - 1.0 - A) * slow),
        middle=middle,
    )


def motion(par: Par, course: Course) -> Motion:
    r"""Return the motor's motion while the pressure follows its course.

    .. math::
        A_{mc} v = C_{mc} \dot p_{mc} + q, \quad q = (p_{mc} - p_{pd})/K_{lf}, \quad
        \eta_g T = k_g (A_{mc} p_{mc} + k_{damp} v) + T_{fr} + M' \dot\Omega

    with eta_g = 1 for gear law "directional", whose loss is in T_fr. Compliances are evaluated at
    the middle of the course. The seals slide.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eqs. (1), (8), (9), (11), (12) and (16).
    """
    k_g, cylinder = par.gear.k_g, par.master_cylinder
    K_lf = pipeline.resistance(par.pipeline, par.fluid)
    C_mc = _chamber_compliance(par, course.middle)
    q_rate = (course.rate - _rate_of_caliper(par, course)) / K_lf
    v = (C_mc * course.rate + (course.p - course.p_pd) / K_lf) / cylinder.A_mc
    acceleration = (C_mc * course.bend + q_rate) / (cylinder.A_mc * k_g)
    omega = v / k_g
    force, rubbing = _load(par, course.p, v, omega)
    limits = ball_screw_gear.friction_bounds(rubbing.T_p, rubbing.T_n, force, par.gear)
    # Bounds are torques on the shaft; against its motion they add to the motor's torque.
    friction = np.where(omega > 0, -np.asarray(limits.low), -np.asarray(limits.high))
    friction = np.where(omega == 0, 0.0, friction)
    efficiency = par.gear.eta_g if par.gear.law == "paper" else 1.0
    inertia = ball_screw_gear.inertia(par.gear) * acceleration / efficiency
    torque = (k_g * force + friction) / efficiency + inertia
    current = torque / par.motor.K_e
    D = par.bridge.D_max
    return Motion(
        omega=omega,
        torque=torque,
        inertia=inertia,
        current=current,
        voltage=par.motor.R_m * current + par.motor.K_e * omega,
        available=D * (par.supply.V_bat - par.supply.R_bat * D * np.abs(current)),
    )


def breakaway_current(par: Par, p: float) -> float:
    """Return the current [A] that holds a pressure [Pa] and starts the piston moving."""
    load, rest = _load(par, p, 0.0, 0.0)
    limit = ball_screw_gear.friction_bounds(rest.T_p, rest.T_n, load, par.gear)
    efficiency = par.gear.eta_g if par.gear.law == "paper" else 1.0
    return float(par.gear.k_g * load - limit.low) / (efficiency * par.motor.K_e)


def geared(par: Par, k_g: float) -> Par:
    """Return the brake with another gear ratio [m/rad] and the same seals and pistons.

    Parameters state the seals' friction as a torque at the shaft. Physically it is a force, so this
    torque increases with the ratio, and its viscous part with the ratio's square. The pressure
    controller's gains, current per pressure, also increase with the ratio, to preserve the
    low-frequency loop gain.
    """
    r = k_g / par.gear.k_g
    powers = {
        "seal.T_pr": 1,
        "seal.f_cfr_p": 1,
        "seal.f_cfr_n": 1,
        "seal.c": 1,
        "seal.mu_T": 2,
        "ecu.est_par.T_pr": 1,
        "ecu.est_par.f_cfr_p": 1,
        "ecu.pressure.k_p": 1,
        "ecu.pressure.k_i": 1,
        "ecu.pressure.k_d": 1,
    }
    values = par.flat()
    return par.replace(
        {name: values[name] * r**n for name, n in powers.items()} | {"gear.k_g": k_g}
    )


def _load(par: Par, p: Any, v: Any, omega: Any) -> tuple[Any, seal.Output]:
    """Return the force on the piston and the friction of the seals, for numbers or arrays."""
    at = master_cylinder.Input(0.0, v, 0.0)
    force = master_cylinder.output(master_cylinder.State(p), at, par.master_cylinder).force
    return force, seal.output(seal.Input(omega, p), par.seal)


def _lag(par: Par, p: float) -> float:
    """Return the time constant of pipeline and caliper [s]."""
    C_pd = caliper.mass(caliper.State(p), par.caliper, par.fluid)
    return C_pd * pipeline.resistance(par.pipeline, par.fluid)


def _rate_of_caliper(par: Par, course: Course) -> Array:
    return (course.p - course.p_pd) / _lag(par, course.middle)


def _chamber_compliance(par: Par, p: float) -> float:
    at = master_cylinder.Input(x=travel_at(p, par), v=0.0, q=0.0)
    volume = master_cylinder.volume(at, par.master_cylinder)
    return brake_fluid.compliance(brake_fluid.Chamber(V=volume, p=p), par.fluid)


# --- The sized actuator on the bench

_WITHOUT_DITHER = {"ecu.dither.waveform": "off"}
_STEP = 20e-6
_SETTLE_PERIODS, _PERIODS = 10, 4
_HARMONICS = 5  # of the recorded sine that the fit includes
_ROUNDS, _CLOSE = 8, 0.01  # corrections of the demand's amplitude; relative error that ends them


def sine_figures(label: str, par: Par, top: float, amplitude: float, f: float) -> list[Kpi]:
    """Return key figures of a pressure sine on the bench, relative to the calculation.

    The loop may be slower than the frequency [Hz] of the sine. So the function corrects mean and
    amplitude of the demand until the pressure, without dither, has the required values.
    """
    mean, swing = top - amplitude, amplitude
    run, reached = _sine_run(par, mean, swing, f), 0.0
    # The fundamental is nearly proportional to the demand, so two or three corrections are enough.
    for _ in range(_ROUNDS):
        run = _sine_run(par, mean, swing, f)
        middle, reached = _fitted(run, f)
        offset = top - amplitude - middle
        is_close = abs(reached / amplitude - 1.0) < _CLOSE and abs(offset) < _CLOSE * amplitude
        if is_close or reached <= 0.0:
            break
        swing *= min(amplitude / reached, 3.0)
        mean += offset
    calculated = motion(par, sine(par, top, amplitude, f))
    power = run["voltage"] * run["i"]
    note = "" if abs(reached / amplitude - 1.0) < 3 * _CLOSE else "did not reach the amplitude"
    text = "on the bench with dither off, relative to the calculation"
    return [
        Kpi(
            f"{label}_bench_amplitude",
            reached,
            "Pa",
            "Pressure amplitude reached on the bench.",
            note,
        ),
        Kpi(
            f"{label}_bench_current",
            float(run["i"].max()) / float(calculated.current.max()),
            "1",
            f"Maximum current of this sine {text}.",
            note,
        ),
        Kpi(
            f"{label}_bench_speed",
            float(np.abs(run["omega"]).max()) / float(np.abs(calculated.omega).max()),
            "1",
            f"Maximum speed of this sine {text}.",
            note,
        ),
        Kpi(
            f"{label}_bench_power",
            float(power.max()) / float(calculated.electrical.max()),
            "1",
            f"Maximum electrical power of this sine {text}.",
            note,
        ),
    ]


def braking_figures(label: str, par: Par, p_from: float, p_to: float) -> list[Kpi]:
    """Return key figures of experiment hard-braking, with the set's dither; pressures in Pa."""
    experiment = hard_braking.EXPERIMENT
    following = {} if experiment.following is None else dict(experiment.following(par))
    options = experiment.defaults.replace({"p_from": p_from, "p_to": p_to, **following})
    (case,) = experiment.cases(par, options, None)
    kpis = {kpi.name: kpi for kpi in experiment.judge({"run": _recorded(case)}, options)}
    names = ("rise_time", "overshoot", "peak_current", "peak_power", "share_sat_current")
    return [
        Kpi(
            f"{label}_braking_{name}",
            kpis[name].value,
            kpis[name].unit,
            f"Hard braking: {kpis[name].definition}",
            kpis[name].note,
        )
        for name in names
    ]


def _sine_run(par: Par, mean: float, swing: float, f: float) -> xr.Dataset:
    w, settle = 2.0 * np.pi * f, _SETTLE_PERIODS / f + 0.5

    def stimulus(t: Array) -> dict[str, Array]:
        return {"p_set": mean + swing * np.sin(w * t)}

    case = case_from_rest(
        "sine",
        par,
        "pressure",
        mean,
        stimulus,
        round(_PERIODS / f, 3),
        _WITHOUT_DITHER,
        settle=settle,
    )
    return _recorded(case)


def _fitted(run: xr.Dataset, f: float) -> tuple[float, float]:
    """Return the pressure's mean and fundamental amplitude [Pa] from a least-squares fit."""
    angle = 2.0 * np.pi * f * run["time"].values
    waves = [wave(n * angle) for n in range(1, _HARMONICS + 1) for wave in (np.sin, np.cos)]
    columns = np.column_stack([np.ones_like(angle), *waves])
    coefficients = np.linalg.lstsq(columns, run["p_mc"].values, rcond=None)[0]
    return float(coefficients[0]), float(np.hypot(coefficients[1], coefficients[2]))


def _recorded(case: Case) -> xr.Dataset:
    run = as_run(case, _STEP)
    trajectory = simulate(run)
    if trajectory.status == "interrupted":
        raise KeyboardInterrupt
    return record(run, trajectory, case.settle, case.keep, {})


# --- The study

Count = Annotated[int, Unit("1", 41.0), Field(ge=3, le=401)]

ASSUMPTIONS = (
    "The gear ratio varies. Motor, rotor inertia, battery, pistons, fluid and efficiency are "
    "constant.",
    "The seal friction is a force at the piston, so its torque at the shaft increases with the "
    "gear ratio.",
    "The pressure follows its demand exactly. The speed follows from the flow through the "
    "pressure-volume curves of chamber, pipeline and caliper. The torque follows from pressure, "
    "friction, efficiency and inertia.",
    "Compliances are evaluated at the middle of the pressure range. The calculation neglects the "
    "winding's inductance.",
    "The seals slide. The motor must also supply the breakaway current at the peak pressure.",
    "The calculation neglects dither, but lists the dither current at the peak pressure.",
    "The limits are the pressure controller's current limit and the bridge voltage at that "
    "current.",
    "On the bench, the pressure controller gains increase with the gear ratio, with no other "
    "tuning.",
)


class Options(ParameterSet):
    """Requirements on the actuator, and the designs to compare."""

    bandwidth: Frequency
    """required bandwidth: frequency of the sine, or bandwidth of the step response"""
    p_peak: Pressure
    """maximum pressure: peak of the sine or final value of the step"""
    amplitude: Pressure
    """sine amplitude"""
    p_from: Pressure
    """start of the step"""
    demand: Literal["sine", "step"]
    """demand that sizes the actuator"""
    k_g_min: GearRatio
    """minimum gear ratio"""
    k_g_max: GearRatio
    """maximum gear ratio"""
    ratios: Count
    """number of gear ratios, logarithmically spaced"""
    f_min: Frequency
    """minimum bandwidth in the map"""
    f_max: Frequency
    """maximum bandwidth in the map"""
    frequencies: Count
    """number of bandwidths, logarithmically spaced"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        ratios, bandwidths = ("k_g_min", "k_g_max", "m/rad"), ("f_min", "f_max", "Hz")
        require_ranges(self, (ratios, bandwidths, ("p_from", "p_peak", "Pa")))
        if not 2.0 * self.amplitude <= self.p_peak:
            raise RuleError(
                "amplitude",
                f"{self.amplitude / 1e5:g} bar",
                f"<= half of p_peak = {self.p_peak / 1e5:g} bar",
                "pressures cannot fall below zero",
            )
        return self


SIZES = {
    "electrical": ("W", "maximum electrical power"),
    "mechanical": ("W", "maximum mechanical power"),
    "torque": ("N*m", "maximum torque"),
    "speed": ("rad/s", "maximum speed"),
    "current": ("A", "maximum current"),
    "inertia_share": ("1", "inertia torque relative to the total"),
    "current_share": ("1", "current relative to its limit"),
    "voltage_share": ("1", "voltage relative to the available voltage"),
}
"""unit and label of each size of a motion"""


_ROWS = 13  # gear ratios of the table
_AT_EDGE = 1e-3  # relative distance from a limit of the range that is treated as on the limit
_SLOWEST, _FASTEST = 1e-2, 1e3  # search range for the highest bandwidth [Hz]
_EXACT = 1e-12  # search tolerance for the logarithm of a ratio or bandwidth


def course(par: Par, options: Options, f: float, demand: str = "") -> Course:
    """Return the demanded pressure at a bandwidth [Hz]."""
    if (demand or options.demand) == "sine":
        return sine(par, options.p_peak, options.amplitude, f)
    return step(par, options.p_from, options.p_peak, f)


def compute(par: Par, options: Options, progress: Progress) -> Findings:
    """Return power versus gear ratio and bandwidth, the best ratio, and its trial on the bench.

    Raises
    ------
    ParameterError
        When the piston cannot reach the peak pressure.
    """
    highest = highest_pressure(par)
    if not options.p_peak < highest:
        raise not_valid(
            "p_peak",
            f"{options.p_peak / 1e5:g} bar",
            f"< {highest / 1e5:.4g} bar",
            "where the piston reaches its end stop. Reduce the pressure, or move the stop "
            "(master_cylinder.x_end)",
        )
    data = _mapped(
        par,
        options,
        options.ratios,
        np.geomspace(options.f_min, options.f_max, options.frequencies),
    )
    k_best = _best_ratio(par, options)
    chosen = geared(par, k_best)
    f, power = options.bandwidth, float(_electrical(chosen, options).max())
    kpis = [
        Kpi("optimum_k_g", k_best, "m/rad", "Gear ratio with the lowest electrical power."),
        *_figures("optimum", chosen, options),
        Kpi("given_k_g", par.gear.k_g, "m/rad", "Gear ratio of the parameter set."),
        *_figures("given", par, options),
    ]
    warnings = _warnings(kpis, k_best, options)
    for n, (label, brake) in enumerate((("optimum", chosen), ("given", par))):
        progress("bench", 0.5 * n)
        kpis += sine_figures(label, brake, options.p_peak, options.amplitude, f)
        kpis += braking_figures(label, brake, options.p_from, options.p_peak)
    progress("bench", 1.0)
    marks = (Mark("optimum", k_best, f), Mark("given gear ratio", par.gear.k_g, f))
    limits = {"current limit": ("current_share", 1.0), "voltage limit": ("voltage_share", 1.0)}
    caption = f"Electrical motor power for a {options.demand}: {power:.3g} W at the optimum."
    maps = {"power": Map("electrical", "k_g", "frequency", caption, marks, limits)}
    return Findings(data, tuple(kpis), ASSUMPTIONS, maps, (_cut(par, options),), warnings)


def _at(par: Par, options: Options, f: float, demand: str = "") -> dict[str, float]:
    """Return the motion's maximum values at a bandwidth [Hz], SI, keyed by the names in `SIZES`.

    Torque, current and power include the piston's breakaway at the peak pressure.
    """
    done, static = (
        motion(par, course(par, options, f, demand)),
        breakaway_current(par, options.p_peak),
    )
    torque = float(np.abs(done.torque).max())
    current = max(torque / par.motor.K_e, static)
    voltage = float(np.max(np.abs(done.voltage) / done.available))
    return {
        "electrical": max(float(done.electrical.max()), par.motor.R_m * static**2),
        "mechanical": float(done.mechanical.max()),
        "torque": max(torque, static * par.motor.K_e),
        "speed": float(np.abs(done.omega).max()),
        "current": current,
        "inertia_share": float(np.abs(done.inertia).max()) / torque,
        "current_share": current / par.ecu.pressure.i_max,
        # If no voltage is available at this current, the ratio would change sign.
        "voltage_share": voltage if bool((done.available > 0).all()) else np.inf,
    }


def _electrical(par: Par, options: Options) -> Array:
    return motion(par, course(par, options, options.bandwidth)).electrical


def _best_ratio(par: Par, options: Options) -> float:
    """Return the gear ratio [m/rad] with the lowest electrical power."""
    from scipy.optimize import minimize_scalar

    def power(z: float) -> float:
        return _at(geared(par, math.exp(z)), options, options.bandwidth)["electrical"]

    # The power has one minimum: inertia decreases with the ratio, and the load increases.
    ends = (math.log(options.k_g_min), math.log(options.k_g_max))
    least = minimize_scalar(power, bounds=ends, method="bounded", options={"xatol": _EXACT})
    return math.exp(least.x)


def fastest(par: Par, options: Options, demand: str) -> float:
    """Return the highest bandwidth [Hz] within the current and voltage limits; NaN for none."""
    from scipy.optimize import bisect

    def excess(z: float) -> float:
        sizes = _at(par, options, math.exp(z), demand)
        return max(sizes["current_share"], sizes["voltage_share"]) - 1.0

    low, high = math.log(_SLOWEST), math.log(_FASTEST)
    if excess(low) > 0.0:
        return math.nan
    # Bisection, because the voltage ratio is infinite if no voltage is available.
    return math.exp(bisect(excess, low, high, xtol=_EXACT))


def _figures(label: str, par: Par, options: Options) -> list[Kpi]:
    sizes = _at(par, options, options.bandwidth)
    texts = {
        "electrical": "Maximum electrical motor power, including copper loss.",
        "mechanical": "Maximum mechanical power, which determines the motor rating.",
        "torque": "Maximum torque, including breakaway at the peak pressure.",
        "speed": "Maximum speed.",
        "current": "Maximum current, including breakaway at the peak pressure.",
        "inertia_share": "Maximum inertia torque (rotor, piston) relative to the maximum torque.",
        "voltage_share": "Maximum ratio of motor voltage to bridge voltage at that current.",
    }
    current = motion(par, course(par, options, options.bandwidth)).current
    copper = par.motor.R_m * np.mean(current**2)
    dither = par.ecu.est_par
    A_dit = dither.k_brk_p * (dither.T_pr + dither.f_cfr_p * options.p_peak) / dither.K_e
    note = "" if par.ecu.dither.waveform != "off" else "dither is off"
    return [
        *(
            Kpi(f"{label}_{name}", sizes[name], SIZES[name][0], text)
            for name, text in texts.items()
        ),
        Kpi(
            f"{label}_copper",
            float(copper),
            "W",
            "Mean copper loss while the pressure follows its demand.",
        ),
        Kpi(
            f"{label}_dither_current",
            A_dit * par.ecu.dither.gain,
            "A",
            "Dither current amplitude at the peak pressure, eq. (20).",
            note,
        ),
        *(
            Kpi(
                f"{label}_fastest_{kind}",
                fastest(par, options, kind),
                "Hz",
                f"Highest bandwidth of the {kind} within the current and voltage limits.",
            )
            for kind in ("sine", "step")
        ),
    ]


def _mapped(par: Par, options: Options, count: int, frequencies: Array) -> xr.Dataset:
    """Return the variables in `SIZES` versus ``count`` gear ratios and the bandwidths [Hz]."""
    ratios = np.geomspace(options.k_g_min, options.k_g_max, count)
    brakes = [geared(par, float(k_g)) for k_g in ratios]
    rows = [[_at(brake, options, float(f)) for f in frequencies] for brake in brakes]
    axes = {"k_g": (ratios, "m/rad", "gear ratio"), "frequency": (frequencies, "Hz", "bandwidth")}
    values = {name: [[sizes[name] for sizes in row] for row in rows] for name in SIZES}
    return labeled(axes, {name: (values[name], *SIZES[name]) for name in SIZES})


def _cut(par: Par, options: Options) -> Cut:
    """Return the sizes versus gear ratio at the required bandwidth."""
    row = _mapped(par, options, _ROWS, np.array([options.bandwidth])).isel(frequency=0)
    names = (
        "electrical",
        "mechanical",
        "torque",
        "speed",
        "inertia_share",
        "current_share",
        "voltage_share",
    )
    return Cut(f"{options.demand} at a bandwidth of {options.bandwidth:g} Hz", row, ("k_g", *names))


def _warnings(kpis: list[Kpi], k_best: float, options: Options) -> tuple[str, ...]:
    value = {kpi.name: kpi.value for kpi in kpis}
    warnings: list[str] = []
    fast = value[f"optimum_fastest_{options.demand}"]
    if not fast >= options.bandwidth:
        warnings.append(
            f"this motor cannot follow the {options.demand} at {options.bandwidth:g} Hz. At the "
            f"best gear ratio, its limits allow {fast:.3g} Hz"
        )
    ends = (options.k_g_min, options.k_g_max)
    return (*warnings, *edge_warnings("k_g", k_best, ends, "m/rad", _AT_EDGE))


STUDY = Study(
    name="actuator-sizing",
    assembly="motorcycle-brake",
    summary="gear ratio and motor power for a bandwidth and a peak pressure, and a simulation test",
    options=Options,
    defaults=Options(
        bandwidth=10.0,
        p_peak=37e5,
        amplitude=3e5,
        p_from=6e5,
        demand="sine",
        k_g_min=1e-4,
        k_g_max=1e-3,
        ratios=41,
        f_min=1.0,
        f_max=30.0,
        frequencies=31,
    ),
    compute=compute,
    ruled={
        "drive.mode": "the study demands pressures",
        "pedal": "the study demands pressures without the pedal",
    },
)
