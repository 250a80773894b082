"""Fault figures of the wedge brake: held moments, with a fault at 0.3 s or from the start."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.running import Result, run
from bywire.plant import roller_screw
from fault_rows.row import Row

SET = "roberts2003"
FROM_START = -9.0
ONSET = 0.3
BARE = (
    ("bearing.C_0", 0.0),
    ("bearing.C_2", 0.0),
    ("bearing.T_nu", 0.0),
    ("screw.eta_f", 1.0),
    ("screw.eta_b", 1.0),
    ("wedge_friction.mu_int", 0.0),
    ("wedge_friction.mu_R", 0.0),
    ("motor_1.T_cog", 0.0),
    ("motor_2.T_cog", 0.0),
    ("flywheel.runout", 0.0),
)
HIGH = (("M_high", 950.0), ("M_low", 950.0))
LOW = (("M_high", 200.0), ("M_low", 200.0))
Pairs = tuple[tuple[str, Any], ...]


def friction(mu_B: float) -> Pairs:
    """Return changes for pads of another friction coefficient, known to the controller."""
    slope = Bench("moment-ramp", SET).par.control.moment.slope_hat
    return (("wedge.mu_B", mu_B), ("control.moment.slope_hat", slope * mu_B / 0.35))


@cache
def result(
    experiment: str,
    changes: Pairs = (),
    fault: str = "",
    value: Any = None,
    onset: float = ONSET,
    options: Pairs = (),
) -> Result:
    """Return an experiment with at most one fault."""
    given = {} if value is None else {"value": value}
    faults = [{"fault": fault, "onset": onset, **given}] if fault else []
    return run(Bench(experiment, SET, dict(changes), options=dict(options), faults=faults))


def figure(name: str, *args: Any, factor: float = 1.0, **given: Any) -> Callable[[], float]:
    """Return a key figure."""
    return lambda: factor * {kpi.name: kpi.value for kpi in result(*args, **given).kpis}[name]


def rows_of(signal: str, begin: float, *args: Any, **given: Any) -> Any:
    """Return a signal from a time [s] on."""
    found: xr.Dataset = result(*args, **given).recordings["run"]
    return found[signal].sel(time=slice(begin, None)).values


def par() -> Any:
    """Return the parameters of the paper's brake."""
    return Bench("moment-ramp", SET).par


def back_driving() -> float:
    """Return the force that back-drives an unpowered motor: C_0/(L/2pi eta_b) [N]."""
    own = par()
    return float(own.bearing.C_0 / (roller_screw.slope(own.screw) * own.screw.eta_b))


def strongest(bearing: bool = False) -> float:
    """Return the force of one motor at the drive's limit [N]; with its own bearing, or without."""
    own = par()
    torque = own.motor_1.K_ref * own.drive.i_max - (own.bearing.C_0 if bearing else 0.0)
    return float(torque * own.screw.eta_f / roller_screw.slope(own.screw))


def needed(mu_B: float) -> Callable[[], float]:
    """Return the motors' force for 950 N m, by the equilibrium of the wedge [N]."""

    def computed() -> float:
        own = par()
        normal = 950.0 / (2.0 * mu_B * own.caliper.r_B)
        return float(normal * (np.tan(own.wedge.alpha) - mu_B))

    return computed


def moved() -> float:
    """Return the travel of the wedge after a screw has jammed [um]."""
    return 1e6 * float(np.ptp(rows_of("x", ONSET + 0.01, "moment-ramp", (), "screw_1.jammed")))


def fight() -> float:
    """Return the change of the preload per micrometer of encoder error [N/um]."""
    error = 3e-3  # rad
    away = roller_screw.slope(par().screw) * error * 1e6
    forces = [
        float(
            np.minimum(
                *(rows_of(name, 0.4, "moment-pulses", (), *fault)[:100] for name in ("f_1", "f_2"))
            ).mean()
        )
        for fault in ((), ("encoder_1.offset", error))
    ]
    return abs(forces[1] - forces[0]) / away


def ripple(fault: str = "") -> Callable[[], float]:
    """Return the peak-to-peak moment with standing screws, without power [N m]."""
    return lambda: float(np.ptp(rows_of("M_B", 1.0, "power-off-hold", (), fault, onset=FROM_START)))


def crossing(known: bool) -> Callable[[], float]:
    """Return the extra time for 0.1 mm more clearance, known to the ECU or not [ms]."""

    def computed() -> float:
        far = ((("caliper.clearance", 0.3e-3),),) if known else ((), "caliper.gap-grown", 1.5)
        times = [
            figure("contact_time", "moment-ramp", *given, onset=FROM_START)() for given in ((), far)
        ]
        return 1e3 * (times[1] - times[0])

    return computed


def mean_moment(fault: str, value: Any) -> Callable[[], float]:
    """Return the change of the held moment by a fault [N m]."""
    options = (("t_hold", 1.0),)
    return lambda: float(
        np.diff(
            [
                result("moment-ramp", (), *given, options=options)
                .recordings["run"]["M_B"]
                .sel(time=slice(0.6, 0.9))
                .values.mean()
                for given in ((), (fault, value))
            ]
        )[0]
    )


def at_stop(*args: Any, **given: Any) -> Callable[[], float]:
    """Return 1 if the wedge reaches an end stop, else 0."""
    return lambda: float(np.abs(rows_of("F_end", 0.0, *args, **given)).max() > 0.0)


def held(signal: str, *args: Any, **given: Any) -> Callable[[], float]:
    """Return the mean of a signal from 0.6 s on."""
    return lambda: float(rows_of(signal, 0.6, *args, **given).mean())


WORN = ("power-off-hold", (), "heart.worn")
WOUND = ("moment-ramp", (), "moment.stuck", 0.0)
LOST = ("moment-ramp", (), "caliper.pad-lost")
CONTROLLED = (
    "28 N m is the ripple in Fig. 7 while the moment control holds 200 N m. With stationary "
    "screws, the ripple is 21.0 N m. The disc turns at 9.5 Hz, near the loop's crossover at 8 "
    "Hz. Without friction, the control reduces the ripple by 12 % to 18.4 N m. Shafts that stick"
    " at every reversal respond late, which increases the ripple. It is 27.5 N m with lossless "
    "screws, 31.5 N m with bywire's friction, and 28.4 N m at a moment of 950 N m"
)
FIVEFOLD = (
    "140 N m is five times 28 N m, but the contribution of sticking does not increase with the "
    "runout. Relative to stationary screws, the ripple is 1.48 at "
    "4 um, 1.19 at 8 um, 1.07 at 12 um and 0.98 at 20 um"
)
STANDING = (
    "2 mu_B r_B K_cal times the peak-to-peak runout is 21.0 N m. With five times the runout, the "
    "ripple is five times as large"
)
CREEP = (
    "0.1 mm corresponds to 0.863 rad at the motors, which takes 7.19 ms at the gap mode's 120 "
    "rad/s. If the ECU assumes the original gap, the additional gap is beyond the assumed "
    "contact point. There, the brake moves at only 10 rad/s, which takes 86.3 ms"
)


def _motors() -> list[Row]:
    hold = "power-off-hold"
    return [
        *(
            Row(
                "power.stuck 1",
                f"remaining moment (initially 500 N m) at mu_B {mu_B:g}",
                kept,
                "N m",
                figure("moment_end", hold, (("wedge.mu_B", mu_B),)),
            )
            for mu_B, kept in ((0.35, 482.0), (0.45, 474.0), (0.5, 471.0), (0.2, 329.0))
        ),
        Row("power.stuck 1", "drift", 0.0, "m", figure("drift", hold)),
        Row(
            "power.stuck 1",
            "end stop reached (1: yes) without friction at mu_B 0.45",
            1.0,
            "1",
            at_stop(hold, friction(0.45) + BARE),
        ),
        Row(
            "drive_1.stuck 0",
            "force that back-drives the dead motor",
            545.0,
            "N",
            back_driving,
            daily=True,
        ),
        Row(
            "drive_1.stuck 0",
            "maximum force of the other motor, 20 A",
            4084.0,
            "N",
            strongest,
            daily=True,
        ),
        Row(
            "drive_1.stuck 0", "force for 950 N m at mu_B 0.2", 3115.0, "N", needed(0.2), daily=True
        ),
        Row(
            "drive_1.stuck 0",
            "reserve, minus the motor's own bearing friction",
            (0.0, 10.0),
            "%",
            lambda: 100.0 * (strongest(bearing=True) / (needed(0.2)() + back_driving()) - 1.0),
            daily=True,
        ),
        *(
            Row(
                f"drive_{k}.stuck 0",
                "achieved moment (demand 950 N m) at mu_B 0.2",
                None,
                "N m",
                held("M_B", "moment-ramp", friction(0.2), f"drive_{k}.stuck", 0.0, options=HIGH),
            )
            for k in (1, 2)
        ),
        Row(
            "screw_1.jammed",
            "maximum travel of the wedge",
            (0.0, 40.0),
            "um",
            moved,
            "26 um of the travel is free play. The other 27 um come from the spring of 24 N/um,"
            " which presses the wedge against the jammed screw with 647 N and then relaxes",
        ),
        Row(
            "motor_1.shorted",
            "achieved moment (demand 200 N m)",
            None,
            "N m",
            held("M_B", "moment-ramp", (), "motor_1.shorted", options=LOW),
        ),
    ]


def _sensors() -> list[Row]:
    return [
        Row("encoder_1.offset", "force fight", (10.0, 99.0), "N/um", fight),
        Row(
            "moment.offset 50 N m",
            "change of the moment",
            -50.0,
            "N m",
            mean_moment("moment.offset", 50.0),
        ),
        Row(
            "moment.stuck 0",
            "current while the wedge is pulled in",
            20.0,
            "A",
            lambda: float(np.abs(rows_of("i_1", 0.0, *WOUND)).max()),
        ),
        Row("moment.stuck 0", "end stop reached (1: yes)", 1.0, "1", at_stop(*WOUND)),
    ]


def _mechanics() -> list[Row]:
    strong = friction(0.6)
    return [
        Row(
            "wedge.friction",
            "motor force, 950 N m at mu_B 0.6",
            -1495.0,
            "N",
            held("F_M", "moment-ramp", strong, options=HIGH),
        ),
        Row(
            "caliper.pad-lost",
            "maximum moment at any travel",
            0.0,
            "N m",
            lambda: float(np.abs(rows_of("M_B", 0.0, *LOST, onset=FROM_START)).max()),
        ),
        Row(
            "caliper.pad-lost",
            "end stop reached (1: yes)",
            1.0,
            "1",
            at_stop(*LOST, onset=FROM_START),
        ),
        Row(
            "heart.worn 5",
            "preload without power",
            0.0,
            "N",
            figure("preload_end", *WORN, onset=FROM_START),
        ),
        Row(
            "heart.worn 5",
            "preload without power, fault-free brake",
            454.0,
            "N",
            figure("preload_end", "power-off-hold"),
        ),
        Row(
            "heart.worn 5",
            "remaining moment",
            482.0,
            "N m",
            figure("moment_end", *WORN, onset=FROM_START),
        ),
        Row(
            "wedge.spring-broken",
            "spring rate, default",
            0.0,
            "N/m",
            lambda: float(par().wedge.k_return),
        ),
        Row(
            "wedge_friction.worn 5",
            "remaining moment (initially 500 N m) without power",
            None,
            "N m",
            figure("moment_end", "power-off-hold", (), "wedge_friction.worn", onset=FROM_START),
        ),
        Row(
            "caliper.gap-grown",
            "extra time, known to the ECU",
            7.2,
            "ms per 0.1 mm",
            crossing(known=True),
        ),
        Row(
            "caliper.gap-grown",
            "extra time, unknown to the ECU",
            None,
            "ms per 0.1 mm",
            crossing(known=False),
            note=CREEP,
        ),
        Row(
            "flywheel.run-out",
            "ripple of the fault-free brake, moment control",
            28.0,
            "N m",
            figure("hold_ripple", "moment-pulses"),
            CONTROLLED,
        ),
        Row(
            "flywheel.run-out 5",
            "ripple, moment control",
            140.0,
            "N m",
            figure("hold_ripple", "moment-pulses", (), "flywheel.run-out", onset=FROM_START),
            FIVEFOLD,
        ),
        *(
            Row(
                f"flywheel.run-out{times}",
                "ripple, stationary screws without power",
                None,
                "N m",
                ripple(fault),
                note=STANDING,
            )
            for times, fault in (("", ""), (" 5", "flywheel.run-out"))
        ),
    ]


ROWS = (*_motors(), *_sensors(), *_mechanics())
