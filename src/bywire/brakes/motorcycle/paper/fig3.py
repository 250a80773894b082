"""Fig. 3: step response and bandwidth of the current loop."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.crossings import bandwidth
from bywire.bench.running import Result
from bywire.brakes.motorcycle.linear import Rotor, current_loop
from bywire.brakes.motorcycle.paper.facts import FACTS
from bywire.brakes.motorcycle.paper.runs import MAIN, PRINTED, Runs, parameters
from bywire.report.step_response import step_response
from bywire.reproduction.item import Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, kpis

LOCKED = {"seal.T_pr": 10.0}
"""overrides that lock the rotor: no torque of this motor overcomes 10 N m"""
BAND = (0.1, 450.0)
P_LOOP = 25e5
"""operating point of the small-signal responses [Pa]; they are insensitive to it"""


def part(runs: Runs) -> Part:
    """Return the step of 0.73 A and the small-signal bandwidths."""
    step, locked = _step(runs, {}), _step(runs, LOCKED)
    items = [
        compared(
            "fig3.bandwidth",
            FACTS["fig3_bandwidth"],
            small_signal(MAIN, "locked", "i_meas"),
            note="-3 dB of the measured current after the 180 Hz filter, small signal, rotor "
            "locked",
            tuned="calibrated",
        ),
        compared(
            "fig3.bandwidth.motor_current",
            FACTS["fig3_bandwidth"],
            small_signal(MAIN, "locked", "i"),
            note="the same gains, the motor current before the filter, rotor locked",
            tuned="calibrated",
        ),
        compared(
            "fig3.bandwidth.free",
            FACTS["fig3_bandwidth"],
            small_signal(MAIN, "free", "i_meas"),
            note="measured current, rotor free: the back-EMF of the moving shaft slows it",
        ),
        compared(
            "fig3.bandwidth.free@table1",
            FACTS["fig3_bandwidth"],
            small_signal(PRINTED, "free", "i_meas"),
            note="measured current, rotor free: Table 1's light rotor moves with the current",
        ),
        compared(
            "fig3.peak",
            FACTS["fig3_top"],
            kpis(locked)["peak_current"],
            note="motor current after the step of 0.73 A, rotor locked",
        ),
        *_step_items("fig3", step, "motor current; the piston breaks away and moves"),
        *_step_items("fig3.locked", locked, "motor current; rotor locked"),
    ]
    text = (
        "The paper identifies the motor and tunes a PI for 100 Hz, but prints neither motor nor "
        "gains. Our gains give the measured current a bandwidth of 100 Hz (-3 dB) with the rotor "
        "locked. If the rotor moves, its back-EMF disturbs the loop. So 'i equals i_set', on which "
        "the paper's identification relies, is true only for a locked or heavy rotor."
    )
    exhibits = (
        Exhibit(
            "fig3",
            lambda: step_response(locked.recordings["run"], "i", "i_ref"),
            "Fig. 3: current after a step of its set point to 0.73 A, rotor locked.",
        ),
        Exhibit(
            "fig3-free",
            lambda: step_response(step.recordings["run"], "i", "i_ref"),
            "The same step with the piston free to move from its rest position, calibrated set.",
        ),
    )
    return Part(
        "Figure 3: current loop",
        text,
        tuple(items),
        exhibits,
        {"fig3-free": step.recordings["run"], "fig3-locked": locked.recordings["run"]},
    )


def small_signal(name: str, rotor: Rotor, output: str) -> float:
    """Return the bandwidth (-3 dB) of the sampled current loop [Hz]."""
    loop = current_loop(parameters(name), P_LOOP, rotor)
    k = loop.outputs.index(output)

    def response(f: NDArray[np.float64]) -> NDArray[np.complex128]:
        return loop.response(f)[:, k, 0]

    return bandwidth(response, BAND)


def _step(runs: Runs, overrides: Mapping[str, Any]) -> Result:
    options = {"i_step": FACTS["fig3_step"].value}
    return runs.bench("current-step", MAIN, overrides, options)


def _step_items(prefix: str, step: Result, note: str) -> list[Item]:
    values = kpis(step)
    return [
        found(f"{prefix}.overshoot", "%", values["overshoot"], note),
        found(f"{prefix}.rise_time", "s", values["rise_time"], f"10 to 90 %; {note}"),
    ]
