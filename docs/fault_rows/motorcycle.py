"""Fault figures of the motorcycle brake."""

from __future__ import annotations

from fault_rows.motorcycle_runs import (
    APPLY,
    FROM_START,
    creep,
    current_ratio,
    ends,
    expansion,
    figure,
    frozen,
    late_with_less,
    most,
    one,
    passes,
    peak_time,
    ratio,
    recording,
    travel,
)
from fault_rows.row import Row

AIR = one("fluid.air-in-line", "1.28 ml", FROM_START)
HOLDS = (*one("seal.swollen", 3.0, FROM_START), *one("battery.lost"))
RELEASES = (*one("seal.swollen", 1.9, FROM_START), *one("battery.lost"))
STUCK = (*one("piston.stuck", "60 N", FROM_START), *one("battery.lost"))
LEAK, CUP = "caliper.leaking", "port.leaking"
CONDUCTANCE = "m**3/(s*Pa)"
FROZEN = (1.7, 19.8, 36.9, 51.4, 51.4, 37.1, 16.6)
AHEAD = 0.75e-3 / 20e-3
PHASE = (
    "in the prototype, the dither is three quarters of an ECU sample ahead. The final pressure "
    "changes by up to 13 bar from sample to sample. With the same lead, all seven pressures "
    "agree to within 1.8 bar, and four of them to within 0.1 bar. In the other three cases, the "
    "brake is still releasing, and a duty cycle of 0.005 corresponds to 1.8 bar"
)
LATE = (
    "with a delay of five ticks, the current loop is unstable. Its phase "
    "crosses -180 degrees at 44 Hz, where its gain is 1.28. Without dither, "
    "it oscillates at 41 Hz with 18 A. It amplifies the 50 Hz dither by a factor of 4.6, to 13.5 "
    "A, in addition to 3.6 A at 41 Hz. Near the resonance, the result depends strongly on the "
    "gain. With 10 % more or less integral gain, the ripple is 12.1 or 8.1 A. With 17 % less, it"
    " is 7 A. "
    "The definition of the reference value is not known. In the computed "
    "current, half the range is 17.3 A, the mean deviation is 8.8 A, and the "
    "difference from the fault-free current is 6.5 A"
)
RIGID = "bywire's line is rigid, as in the paper, so only the pads are compliant"


def _seal() -> list[Row]:
    return [
        Row("seal.swollen 1.9", "remaining pressure without power", 3.0, "bar", ends(RELEASES)),
        Row(
            "seal.swollen 3",
            "fraction of time stuck, step from 6 to 37 bar",
            87.0,
            "%",
            figure("share_stuck", "seal.swollen", 3.0, factor=100.0),
        ),
        Row(
            "seal.swollen 3",
            "deviation from the demand",
            1.7,
            "bar",
            lambda: abs(figure("steady_state_error", "seal.swollen", 3.0, factor=1e-5)()),
        ),
        Row("seal.swollen 3", "pressure held without power", 37.0, "bar", ends(HOLDS)),
    ]


def _supply() -> list[Row]:
    weak = "supply.under-voltage"
    return [
        Row(
            "battery.lost",
            "time until the pressure is below 5 bar",
            520.0,
            "ms",
            passes(one("battery.lost"), 5.0),
            daily=True,
        ),
        Row(
            "battery.lost", "remaining pressure", 1.37, "bar", ends(one("battery.lost")), daily=True
        ),
        Row(
            "battery.shorted",
            "time until the pressure is below 5 bar",
            1250.0,
            "ms",
            passes(one("battery.shorted"), 5.0),
        ),
        Row("battery.shorted", "remaining pressure", 1.84, "bar", ends(one("battery.shorted"))),
        Row(
            weak + " 6 V",
            "rise time from 6 to 37 bar",
            87.0,
            "ms",
            figure("rise_time", weak, factor=1e3),
        ),
        Row(weak + " 6 V", "increase in rise time", 40.0, "%", ratio("rise_time", weak)),
        Row(weak + " 6 V", "overshoot", 12.0, "%", figure("overshoot", weak)),
        Row(
            weak + " 6 V",
            "fraction of time at the duty limit",
            7.0,
            "%",
            figure("share_sat_duty", weak, factor=100),
        ),
        Row(
            "bridge.open-phase",
            "time until the pressure is below 5 bar",
            520.0,
            "ms",
            passes(one("bridge.open-phase"), 5.0),
        ),
        Row("bridge.open-phase", "remaining pressure", 1.37, "bar", ends(one("bridge.open-phase"))),
        *(
            row
            for duty, after, current in ((0.5, 42.0, 17.0), (1.0, 21.0, 32.0))
            for fault in (one("bridge.stuck", duty),)
            for row in (
                Row(
                    f"bridge.stuck {duty:g}",
                    "time until the pressure is above 45 bar",
                    after,
                    "ms",
                    passes(fault, 45.0),
                ),
                Row(f"bridge.stuck {duty:g}", "steady pressure", (52.0, 54.0), "bar", ends(fault)),
                Row(f"bridge.stuck {duty:g}", "current", current, "A", ends(fault, "i", 1.0)),
            )
        ),
    ]


def _motor_and_sensors() -> list[Row]:
    return [
        Row("motor.hot 2", "increase in rise time", 8.0, "%", ratio("rise_time", "motor.hot")),
        Row(
            "motor.hot 2",
            "steady-state error",
            0.34,
            "bar",
            figure("steady_state_error", "motor.hot", factor=1e-5),
        ),
        Row("motor.hot 2", "overshoot", 6.1, "%", figure("overshoot", "motor.hot")),
        Row("motor.hot 2", "held pressure", 37.0, "bar", ends(one("motor.hot"))),
        Row(
            "motor.demagnetized 0.7",
            "current relative to the fault-free current",
            1.43,
            "1",
            current_ratio,
            "the ECU's parameters assume strong magnets, so its dither is also weaker. The "
            "piston sticks permanently, and friction supports part of the load. With the correct"
            " torque constant in the ECU, the value is 1.42",
        ),
        Row("current.stuck 0", "peak", 45.5, "bar", most(one("current.stuck", "0 A"))),
        Row("current.stuck 0", "time of the peak", 36.0, "ms", peak_time),
        Row(
            "current.stuck 0",
            "pressure after the peak",
            37.0,
            "bar",
            ends(one("current.stuck", "0 A")),
        ),
        Row("current.gain 0.5", "peak", 39.4, "bar", most(one("current.gain", 0.5))),
        Row(
            "current.gain 0.5",
            "pressure after the peak",
            37.0,
            "bar",
            ends(one("current.gain", 0.5)),
        ),
        *(
            Row(
                f"pressure.offset {offset}",
                "steady pressure",
                stays,
                "bar",
                ends(one("pressure.offset", f"{offset} bar")),
                daily=offset == 2,
            )
            for offset, stays in ((2, 35.1), (-2, 39.1), (5, 32.1))
        ),
        Row(
            "pressure.drift -1 bar/s",
            "pressure after 2.5 s",
            39.5,
            "bar",
            ends(one("pressure.drift", "-1 bar/s")),
        ),
        *(
            row
            for level, after in ((20, 34.0), (0, 31.0))
            for fault in (one("pressure.stuck", f"{level} bar"),)
            for row in (
                Row(
                    f"pressure.stuck {level} bar",
                    "time until the pressure is above 45 bar",
                    after,
                    "ms",
                    passes(fault, 45.0),
                ),
                Row(f"pressure.stuck {level} bar", "steady pressure", 52.0, "bar", ends(fault)),
            )
        ),
        Row(
            "pressure.stuck 50 bar",
            "time until the pressure is below 5 bar",
            96.0,
            "ms",
            passes(one("pressure.stuck", "50 bar"), 5.0),
        ),
        Row(
            "pressure.stuck 50 bar",
            "current",
            -21.0,
            "A",
            ends(one("pressure.stuck", "50 bar"), "i", 1.0),
        ),
    ]


def _controller() -> list[Row]:
    return [
        Row(
            "ecu.dropped 2", "steady pressure", 36.7, "bar", ends(one("ecu.dropped", 2), rows=1000)
        ),
        Row(
            "ecu.dropped 5",
            "steady pressure",
            36.2,
            "bar",
            ends(one("ecu.dropped", 5), rows=1000),
            "the ECU runs only every fifth tick, but bywire's controller treats "
            "differences over five sample times as differences over one sample time. "
            "The derivative term is then five times as large, and the demand alternates between "
            "+-20 A",
        ),
        Row("bridge.late 5", "peak", 38.5, "bar", most(one("bridge.late", 5))),
        Row(
            "bridge.late 5",
            "standard deviation of the current ripple",
            7.0,
            "A",
            lambda: float(recording(one("bridge.late", 5))["i"].values[-1000:].std()),
            LATE,
        ),
        Row(
            "bridge.late 5",
            "current ripple with 17 % less integral gain",
            None,
            "A",
            late_with_less,
            note=(
                "with this gain and without dither, the current loop does not oscillate (see above)"
            ),
        ),
        Row(
            "ecu.frozen",
            "minimum pressure of seven phases",
            min(FROZEN),
            "bar",
            lambda: min(frozen()),
            PHASE,
        ),
        Row(
            "ecu.frozen",
            "maximum pressure of seven phases",
            max(FROZEN),
            "bar",
            lambda: max(frozen()),
        ),
        Row(
            "ecu.frozen",
            "maximum deviation of the seven phases, dither 0.75 ms ahead",
            None,
            "bar",
            lambda: max(
                abs(ours - theirs) for ours, theirs in zip(frozen(AHEAD), FROZEN, strict=True)
            ),
        ),
        Row(
            "p_set.lost",
            "steady pressure, with the last demand held",
            37.0,
            "bar",
            ends(one("p_set.lost")),
        ),
        Row("gear.jammed", "pressure after the fault", 37.0, "bar", ends(one("gear.jammed"))),
    ]


def _fluid() -> list[Row]:
    little = one("fluid.air", "0.0088 ml", FROM_START)
    slow = one(LEAK, f"1e-14 {CONDUCTANCE}")
    return [
        Row("fluid.air 0.0088 ml", "travel at 37 bar", 8.62, "mm", lambda: travel(little)),
        Row("fluid.air 0.0088 ml", "travel at 37 bar without air", 8.53, "mm", lambda: travel(())),
        Row("fluid.air-in-line 1.28 ml", "steady pressure", 0.6, "bar", ends(AIR, options=APPLY)),
        Row("fluid.air-in-line 1.28 ml", "current", 19.8, "A", ends(AIR, "i", 1.0, options=APPLY)),
        Row(
            "fluid.air-in-line 0.123 ml",
            "maximum pressure",
            37.0,
            "bar",
            ends(one("fluid.air-in-line", "0.123 ml", FROM_START), options=APPLY),
        ),
        Row(f"{LEAK} 1e-14", "steady pressure", 37.09, "bar", ends(slow)),
        Row(f"{LEAK} 1e-14", "creep of the piston", 0.41, "mm/s", lambda: creep(recording(slow))),
        *(
            Row(
                f"{fault} {g}",
                "time until the pressure is below 5 bar",
                after,
                "ms",
                passes(one(fault, f"{g} {CONDUCTANCE}"), 5.0),
            )
            for fault in (LEAK, CUP)
            for g, after in (("1e-13", 1970.0), ("1e-12", 200.0))
        ),
        Row(
            "caliper.heated 5 ml",
            "pressure rise, rigid line",
            0.43,
            "bar/K",
            lambda: expansion(5e-6, 6.0),
        ),
        Row(
            "caliper.heated 5 ml",
            "drag pressure after heating by 30 K",
            (7.0, 13.0),
            "bar",
            lambda: 30.0 * expansion(5e-6, 6.0),
        ),
        Row(
            "caliper.heated 5 ml",
            "pressure rise, compliant line",
            0.24,
            "bar/K",
            lambda: expansion(5e-6, 6.0),
            RIGID,
        ),
        Row(
            "caliper.heated 64 ml",
            "pressure rise with all fluid heated, compliant line",
            3.1,
            "bar/K",
            lambda: expansion(64e-6, 1.0),
            RIGID,
        ),
        Row(
            "caliper.knocked-back 0.3 mm",
            "additional piston travel",
            1.0,
            "mm",
            lambda: travel(one("caliper.knocked-back", "0.3 mm", FROM_START)) - travel(()),
        ),
        Row(
            "piston.stuck 60 N",
            "remaining pressure at the pads without power",
            None,
            "bar",
            ends(STUCK),
        ),
    ]


ROWS = (*_supply(), *_motor_and_sensors(), *_controller(), *_seal(), *_fluid())
