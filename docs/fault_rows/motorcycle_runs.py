"""Runs of the motorcycle brake: full braking at 37 bar with a fault at 1.5 s."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.bench.faults.injected import with_faults
from bywire.bench.recording import record
from bywire.bench.running import run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.simulation.run import simulate

ONSET = 1.5
FROM_START = -9.0
HOLD = (("p_from", "37 bar"), ("p_to", "37.0001 bar"), ("duration", "4 s"))
APPLY = (("p_from", "0.01 bar"), ("p_to", "37 bar"), ("duration", "4 s"))
SET = "dardanelli2010"
Faults = tuple[tuple[str, Any, float], ...]


@cache
def recording(faults: Faults, options: tuple[tuple[str, str], ...] = HOLD) -> xr.Dataset:
    """Return a recording of full braking with faults: name, value and onset [s] of each."""
    sections = [
        {"fault": name, "onset": onset, **({} if value is None else {"value": value})}
        for name, value, onset in faults
    ]
    return run(Bench("hard-braking", SET, {}, options=dict(options), faults=sections)).recording


@cache
def figures(fault: str = "", value: Any = None) -> dict[str, float]:
    """Return the key figures of the step from 6 to 37 bar with a fault from the start."""
    given = {} if value is None else {"value": value}
    faults = [{"fault": fault, "onset": FROM_START, **given}] if fault else []
    return {kpi.name: kpi.value for kpi in run(Bench("hard-braking", SET, faults=faults)).kpis}


def one(name: str, value: Any = None, onset: float = ONSET) -> Faults:
    """Return a single fault."""
    return ((name, value, onset),)


def bars(found: xr.Dataset) -> Any:
    """Return the pressure at the pads [bar]."""
    return found["p_pd"].values / 1e5


def passes(faults: Faults, level: float) -> Callable[[], float]:
    """Return the time from the onset until the pressure of 37 bar passes a level [ms]."""

    def computed() -> float:
        found = recording(faults)
        t, p = found["time"].values, bars(found)
        beyond = (p < level if level < 37.0 else p > level) & (t >= ONSET)
        return 1e3 * (float(t[np.argmax(beyond)]) - ONSET) if beyond.any() else np.inf

    return computed


def ends(
    faults: Faults,
    signal: str = "p_pd",
    factor: float = 1e-5,
    rows: int = 100,
    options: tuple[tuple[str, str], ...] = HOLD,
) -> Callable[[], float]:
    """Return the mean of a signal over the last rows, 1 ms each."""
    return lambda: factor * float(recording(faults, options)[signal].values[-rows:].mean())


def most(faults: Faults, signal: str = "p_pd", factor: float = 1e-5) -> Callable[[], float]:
    """Return the largest value of a signal after the onset."""
    return lambda: factor * float(recording(faults)[signal].sel(time=slice(ONSET, None)).max())


def ratio(name: str, fault: str, value: Any = None) -> Callable[[], float]:
    """Return the increase of a key figure of the step by a fault [%]."""
    return lambda: 100.0 * (figures(fault, value)[name] / figures()[name] - 1.0)


def figure(name: str, fault: str, value: Any = None, factor: float = 1.0) -> Callable[[], float]:
    """Return a key figure of the step."""
    return lambda: factor * figures(fault, value)[name]


@cache
def frozen(ahead: float = 0.0) -> tuple[float, ...]:
    """Return the pads' pressure 1.1 s after the ECU froze, at seven phases of the dither [bar].

    ``ahead``: lead of the dither over our own, as a share of its period.
    """
    bench = Bench("hard-braking", SET, options=dict(HOLD))
    (case,) = bench.cases()
    begun = replace(case, memory=case.memory._replace(dit_phase=ahead), start=None)
    found = []
    for t in (ONSET + 3e-3 * k for k in range(7)):
        (faulty,) = with_faults([begun], [{"fault": "ecu.frozen", "onset": t}])
        own = as_run(faulty, bench.step)
        rows = record(own, simulate(own), faulty.settle, faulty.keep, {})
        found.append(float(np.interp(t + 1.1, rows["time"].values, bars(rows))))
    return tuple(found)


def late_with_less() -> float:
    """Return the deviation of the current of a late bridge with less integral gain [A]."""
    less = {"ecu.current.k_i": "-17 %"}
    late = [{"fault": "bridge.late", "value": 5, "onset": ONSET}]
    found = run(Bench("hard-braking", SET, less, options=dict(HOLD), faults=late)).recording
    return float(found["i"].values[-1000:].std())


def peak_time() -> float:
    """Return the time of the highest pressure after the current sensor fails [ms]."""
    p = recording(one("current.stuck", "0 A"))["p_pd"].sel(time=slice(ONSET, None))
    return 1e3 * (float(p["time"].values[int(np.argmax(p.values))]) - ONSET)


def creep(found: xr.Dataset) -> float:
    """Return the speed of the creeping piston over whole periods of the dither [mm/s]."""
    x = found["x_mc"].values
    return 1e3 * float(x[-1] - x[-1001])


def current_ratio() -> float:
    """Return the ratio of the currents with weak and with good magnets."""
    weak, good = (
        float(recording(faults)["i"][-1000:].mean())
        for faults in (one("motor.demagnetized", 0.7), ())
    )
    return weak / good


LOW = (("p_from", "1e-5 bar"), ("p_to", "37 bar"), ("duration", "4 s"))


def travel(faults: Faults) -> float:
    """Return the piston travel at 37 bar, of a brake applied from zero pressure [mm]."""
    return 1e3 * float(recording(faults, LOW)["x_mc"].values[-1000:].mean())


@cache
def expansion(volume: float, duration: float) -> float:
    """Return the pressure rise of a warming volume [m3] behind a blocked port [bar/K]."""
    par, rate = Bench("hard-braking", SET).par, 5.0
    case = case_from_rest(
        "run",
        par,
        "current-source",
        0.0,
        lambda t: {"i_set": 0.0 * t},
        duration,
        {
            "caliper.fluid_heat": "warming",
            "caliper.T_rate": rate,
            "caliper.V_hot": volume,
            "port.law": "dead-stroke",
            "port.G_port": 0.0,
        },
    )
    own = as_run(case, 2e-5)
    found = record(own, simulate(own), 0.0, 0.0, {})
    return float(bars(found)[-1]) / (rate * duration)
