"""Your own hydraulic brake in one file: motor, gear, rack, master cylinder, caliper.

All elements come from `bywire.plant`. Only the brake itself is new. The tutorial
"Your own hydraulic brake" explains this file from top to bottom.
"""

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import (
    Assembly,
    Brake,
    CitedSet,
    Duration,
    Integral,
    Limited,
    Loop,
    ParameterSet,
    Part,
    Point,
    Quantity,
    Role,
    Signal,
    Task,
    Unit,
    Voltage,
    Wire,
    chosen,
    derived,
)
from bywire.core import ops
from bywire.plant import (
    brake_fluid,
    caliper,
    cup_seal,
    dc_motor,
    end_stop,
    master_cylinder,
    pipeline,
    planetary_gear,
    rack,
    shaft,
)

VoltagePerPressure = Annotated[float, Unit("V/Pa", 1e-6), Field(ge=0, allow_inf_nan=False)]
VoltagePerPressureTime = Annotated[float, Unit("V/(Pa*s)", 1e-5), Field(ge=0, allow_inf_nan=False)]


class Control(ParameterSet):
    """PI pressure control with anti-windup, whose output is the motor voltage."""

    k_p: VoltagePerPressure
    """proportional gain"""
    k_i: VoltagePerPressureTime
    """integral gain"""
    v_max: Voltage
    """maximum voltage"""
    T_s: Duration
    """sample time"""


class Parameters(ParameterSet):
    """Parameters of the elements and the controller."""

    motor: dc_motor.Parameters
    shaft: shaft.Parameters
    gear: planetary_gear.Parameters
    rack: rack.Parameters
    seal: cup_seal.Parameters
    fluid: brake_fluid.Parameters
    master_cylinder: master_cylinder.Parameters
    stop: end_stop.Parameters
    pipeline: pipeline.Parameters
    caliper: caliper.Parameters
    control: Control


class Stimulus(NamedTuple):
    """External inputs."""

    p_set: Annotated[float, Signal("Pa", "pressure demand", 3e6)]


class Memory(NamedTuple):
    """Memory of the controller between its ticks."""

    v: Annotated[float, Signal("V", "motor voltage", 5.0), Limited("control.v_max")]
    v_i: Annotated[float, Signal("V", "integral term", 5.0)]
    sat_voltage: Annotated[float, Signal("1", "voltage limited")]


def control(x, m, u, par):
    """Run the pressure control once. The integral stops while the voltage is limited."""
    c = par.control
    error = u.p_set - x.p_mc
    wanted = c.k_p * error + m.v_i
    is_free = ops.fabs(wanted) < c.v_max
    return Memory(
        v=ops.clip(wanted, -c.v_max, c.v_max),
        v_i=m.v_i + ops.where(is_free, c.k_i * c.T_s * error, 0.0),
        sat_voltage=ops.where(is_free, 0.0, 1.0),
    )


class HydraulicBrake(Assembly[Parameters, Memory]):
    """A brake with one dry friction at the motor shaft, due to gears and cup seal."""

    name = "hydraulic-brake"
    Memory, Stimulus = Memory, Stimulus
    frictions = ("omega",)
    limits = ("p_mc",)  # the cup seal admits fluid, so the pressure never falls below ambient
    shared = ("fluid",)

    E_source = Integral("J", "energy from the supply", role=Role("source", "supply"))
    motor = Part(dc_motor, loss="E_copper")
    shaft = Part(shaft, loss="E_bearing")
    gear = Part(planetary_gear)
    rack = Part(rack, output={"x": "travel"})
    seal = Part(cup_seal)
    E_friction = Integral("J", "loss in gears and seal", role=Role("sink", "dry friction"))
    chamber = Part(master_cylinder, par="master_cylinder", state={"p": "p_mc"}, loss="E_damping")
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    line = Part(pipeline, par="pipeline", output=("q", "Re"), loss="E_pipeline")
    pads = Part(caliper, par="caliper", state={"p": "p_pd"})

    load = Wire("N", "load on the piston", 1e3)

    def wire(self, w):
        """Connect the parts, from the line back to the motor."""
        carrier = planetary_gear.output(
            planetary_gear.Input(w.shaft.x.theta, w.shaft.x.omega, 0.0), w.gear.par
        )
        piston = rack.output(rack.Input(carrier.theta, carrier.omega, 0.0), w.rack.par)
        cylinder = w.chamber.par
        w.stop.u = end_stop.Input(piston.x, piston.v, cylinder.x_rest, cylinder.x_end)
        w.line.u = pipeline.Input(w.chamber.x.p, w.pads.x.p)
        q = pipeline.output(w.line.u, w.line.par, w.par.fluid).q
        w.pads.u = caliper.Input(q)
        w.chamber.u = master_cylinder.Input(piston.x, piston.v, q)
        force = master_cylinder.output(w.chamber.x, w.chamber.u, cylinder).force
        w.load = force + end_stop.load(w.stop.f)
        w.seal.u = cup_seal.Input(piston.v, w.chamber.x.p)
        w.rack.u = rack.Input(carrier.theta, carrier.omega, w.load)
        pinion = rack.output(w.rack.u, w.rack.par)
        w.gear.u = planetary_gear.Input(w.shaft.x.theta, w.shaft.x.omega, pinion.load)
        sun = planetary_gear.output(w.gear.u, w.gear.par)
        w.motor.u = dc_motor.Input(w.m.v, w.shaft.x.omega)
        torque = dc_motor.output(w.motor.x, w.motor.par).torque
        w.shaft.u = shaft.Input(torque - sun.load, 0.0)

    def friction(self, w):
        """Return the limits of the dry friction at the shaft. At rest it is between them."""
        per_force = w.rack.par.r_p / planetary_gear.ratio(w.gear.par)
        gears = planetary_gear.friction(w.gear.u, w.gear.par)
        gears = gears + rack.friction(w.rack.u, w.rack.par) / planetary_gear.ratio(w.gear.par)
        seal = cup_seal.output(w.seal.u, w.seal.par)
        return ((-gears - per_force * seal.F_p, gears + per_force * seal.F_n),)

    def power(self, w):
        """Return the powers that the parts do not determine: supply and friction."""
        return {
            "E_source": w.m.v * w.motor.x.i,
            "E_friction": -w.reaction[0] * w.shaft.x.omega,
        }

    def tasks(self, par):
        """Return the controller and its sample time."""
        return (Task("control", par.control.T_s, control),)

    def rest(self, par):
        """Return the piston at its retracted end, without pressure."""
        theta = par.master_cylinder.x_rest / travel_per_angle(par)
        return self.state(shaft=shaft.State(theta, 0.0)), Memory(0.0, 0.0, 0.0)


def travel_per_angle(par):
    """Return the piston travel per motor angle [m/rad]."""
    return par.rack.r_p / planetary_gear.ratio(par.gear)


def held(par, p):
    """Return the state and memory at which the motor alone holds a pressure [Pa]."""
    cylinder, pads, fluid = par.master_cylinder, par.caliper, par.fluid
    taken = p * pads.A_pd**2 / pads.K_pd  # volume in the caliper
    chamber = cylinder.A_mc * (cylinder.s_mc - cylinder.x_rest)
    # The remaining stroke compresses the fluid in the chamber.
    stroke = (taken + chamber * (1.0 - ops.exp(-p / fluid.beta))) / cylinder.A_mc
    theta = (cylinder.x_rest + stroke) / travel_per_angle(par)
    i = p * cylinder.A_mc * travel_per_angle(par) / par.motor.K_e
    state = HydraulicBrake.state(
        motor=dc_motor.State(i),
        shaft=shaft.State(theta, 0.0),
        chamber=master_cylinder.State(p),
        pads=caliper.State(p),
    )
    v = par.motor.R_m * i
    return state, Memory(v, v, 0.0)


def point(par, p):
    """Return the brake in equilibrium at a pressure [Pa]."""
    return Point(HydraulicBrake(), par, *held(par, p), Stimulus(p_set=p))


PRESSURE = Loop(
    name="hydraulic-pressure",
    assembly="hydraulic-brake",
    summary="pressure control through the motor voltage, at 1 kHz",
    at=Quantity("pressure", "Pa", 30e5),
    inputs=("p_set",),
    output="p_mc",
    cut="v",
    point=point,
    causes={
        "seal friction": {"seal.F_pr": 0.0, "seal.f_p": 0.0, "seal.f_n": 0.0},
        "gear friction": {"gear.eta": 1.0, "rack.eta": 1.0},
    },
    band=(0.1, 60.0),
    amplitudes=(1e5, 5e5),
    tunables={"control.k_p": (1e-8, 1e-4), "control.k_i": (1e-7, 1e-2)},
)

_MOTOR = "catalogs of 60 mm brushed motors for 12 V"
_LAYOUT = "30 bar at 10 A, 60 bar within the motor voltage"
_NUMBERS = {
    "motor.R_m": chosen(0.2, _MOTOR),
    "motor.L_m": chosen(2e-4, _MOTOR),
    "motor.K_e": chosen(0.06, _MOTOR),
    "shaft.J": chosen(8e-5, f"{_MOTOR}, with the sun"),
    "shaft.d": chosen(2e-5, "bearings and brushes"),
    "gear.z_sun": chosen(15.0, _LAYOUT),
    "gear.z_ring": chosen(75.0, _LAYOUT),
    "gear.eta": chosen(0.96, "one spur gear stage"),
    "rack.r_p": chosen(4e-3, _LAYOUT),
    "rack.eta": chosen(0.94, "straight teeth"),
    "seal.F_pr": chosen(15.0, "two cups in a 19 mm bore"),
    "seal.f_p": chosen(6e-6, "2 % of the piston load"),
    "seal.f_n": chosen(6e-6, "same in both directions"),
    "seal.k_brk": chosen(1.5, "elastomer, greased"),
    "seal.v_S": chosen(5e-4, "elastomer, greased"),
    "seal.mu": chosen(50.0, "elastomer, greased"),
    "fluid.beta": chosen(1.5e9, "DOT 4 with its hoses"),
    "fluid.nu": chosen(1.5e-5, "DOT 4 at 20 degC"),
    "fluid.rho": chosen(1.05e3, "DOT 4"),
    "fluid.air": chosen("none", "bled"),
    "fluid.V_air": chosen(0.0, "bled"),
    "fluid.n_air": chosen(1.2, "between isothermal and adiabatic"),
    "fluid.p_atm": chosen(101325.0, "standard atmosphere"),
    "master_cylinder.A_mc": derived(2.835e-4, "19 mm bore"),
    "master_cylinder.s_mc": chosen(0.03, "chamber length"),
    "master_cylinder.x_rest": chosen(1e-4, "retracted end"),
    "master_cylinder.x_end": chosen(0.02, "20 mm stroke"),
    "master_cylinder.x_nominal": chosen(5e-3, "travel at 30 bar"),
    "master_cylinder.k_damp": chosen(200.0, "guides"),
    "stop.k_stop": chosen(2e7, "steel on steel"),
    "stop.tau_stop": chosen(1e-4, "no noticeable rebound"),
    "pipeline.d_pl": chosen(3.2e-3, "motorcycle hose"),
    "pipeline.L_pl": chosen(0.8, "motorcycle hose"),
    "pipeline.k_lf": chosen(8.0, "Hagen-Poiseuille"),
    "pipeline.Re_max": chosen(2000.0, "laminar"),
    "caliper.law": chosen("linear", "pads and caliper as one spring"),
    "caliper.A_pd": chosen(1.6e-3, "two pistons of 32 mm"),
    "caliper.K_pd": chosen(6e6, "1.3 ml at 30 bar"),
    "caliper.p_table": chosen((), "no measured curve"),
    "caliper.V_table": chosen((), "no measured curve"),
    "caliper.leak": chosen("tight", "no fault"),
    "caliper.G_leak": chosen(0.0, "no fault"),
    "caliper.fluid_heat": chosen("off", "no fault"),
    "caliper.V_hot": chosen(5e-6, "fluid volume of a caliper of this size"),
    "caliper.alpha_V": chosen(7e-4, "glycol ethers"),
    "caliper.T_rate": chosen(0.0, "no fault"),
    "control.k_p": chosen(2e-6, "hand-tuned, before the design"),
    "control.k_i": chosen(2e-5, "hand-tuned, before the design"),
    "control.v_max": chosen(12.0, "battery"),
    "control.T_s": chosen(1e-3, "1 kHz"),
}
SET = CitedSet(
    "hydraulic-1",
    "hydraulic-brake",
    "our own layout",
    "a hydraulic brake with hand-tuned control",
    Parameters,
    _NUMBERS,
)
BRAKE = Brake("hydraulic", "motor, planetary gear, rack, master cylinder, caliper", __name__)
