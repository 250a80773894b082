"""Dither of the motorcycle brake: amplitude and frequency that overcome friction at least price."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.motorcycle.dither.choice import NAMES, Candidate, best_of, candidates
from bywire.brakes.motorcycle.dither.dithered_plant import dithered_plant
from bywire.brakes.motorcycle.dither.map import (
    Grid,
    by_frequency,
    by_pressure,
    figures_of,
    law,
    mapped,
)
from bywire.brakes.motorcycle.dither.options import ASSUMPTIONS, DEFAULTS, Options
from bywire.brakes.motorcycle.dither.reach import admissible_frequencies
from bywire.brakes.motorcycle.dither.trial import FIGURES, Trial, area_ratios, tried
from bywire.brakes.motorcycle.dither.waveforms import compared
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import highest_pressure
from bywire.core.errors import InputError, ParameterError, RunError
from bywire.core.typing import Progress
from bywire.synthesis.study import Findings, Map, Mark, Study

Par = MotorcycleParameters


def compute(par: Par, options: Options, progress: Progress) -> Findings:
    """Return figures over gain and frequency, the dither of least price, and its comparison.

    Raises
    ------
    ParameterError
        When a pressure cannot be reached, or no frequency fits the ECU's sampling.
    """
    _require_reachable(par, options)
    dithered = par
    if par.ecu.dither.waveform == "off":
        dithered = par.replace({"ecu.dither.waveform": "sine"})
    grid = grid_of(dithered, options)
    figures = figures_of(dithered, grid, lambda share: progress("dithers", share))
    limits = limits_of(options)
    data = mapped(dithered, grid, figures, limits)
    each = candidates(np.asarray(grid.gains), figures, limits)
    best = best_of(each)
    given = (dithered.ecu.dither.gain, dithered.ecu.dither.f_dit)
    designs = {"given": given}
    if best is not None:
        designs = {"optimum": (each[best].gain, grid.frequencies[best]), **designs}
    kpis = _kpis(dithered, options, grid, designs)
    cuts = [by_frequency(grid, each), by_pressure(dithered, data)]
    if best is not None:
        kpis += law(dithered, data, best, grid)
    if options.compare == "waveforms":
        f = designs.get("optimum", given)[1]
        cuts.append(compared(dithered, grid, f, limits, lambda share: progress("waveforms", share)))
    return Findings(
        data,
        tuple(kpis),
        ASSUMPTIONS,
        _maps(data, options, designs),
        tuple(cuts),
        _warnings(options, grid, each, best),
        _limits(grid, each, best),
    )


def grid_of(par: Par, options: Options) -> Grid:
    """Return the dithers to compare."""
    return Grid(
        options.pressures,
        [float(g) for g in np.linspace(options.gain_min, options.gain_max, options.gains)],
        admissible_frequencies(par, options.f_min, options.f_max, options.frequencies),
        Trial(settle=options.settle, approach=options.approach),
    )


def limits_of(options: Options) -> dict[str, float]:
    """Return the largest admissible value of every figure that has one."""
    return {
        "stuck": options.stuck_max,
        "band": options.band_max,
        "ripple_caliper": options.ripple_max,
        "current_share": 1.0,
        "duty_share": 1.0,
    }


def _require_reachable(par: Par, options: Options) -> None:
    highest, wanted = highest_pressure(par), max(options.pressures) + options.approach
    if not wanted < highest:
        raise ParameterError(
            f"pressures: {max(options.pressures) / 1e5:g} bar, approached from {wanted / 1e5:g} "
            f"bar, is not admissible: the piston meets its end stop at {highest / 1e5:.4g} bar"
        )


def _kpis(
    par: Par, options: Options, grid: Grid, designs: dict[str, tuple[float, float]]
) -> list[Kpi]:
    """Return what each design does on the bench: not interpolated."""
    ratios = area_ratios(par, list(designs.values()))
    kpis = []
    for (label, (gain, f)), ratio in zip(designs.items(), ratios, strict=True):
        each = [tried(par, p, (gain,), (f,), grid.trial) for p in grid.pressures]
        kpis += [
            Kpi(f"{label}_gain", gain, "1", "Gain of the dither's law, eqs. (18) and (19)."),
            Kpi(f"{label}_frequency", f, "Hz", "Frequency of the dither."),
        ]
        limits = limits_of(options)
        for name, (unit, text) in FIGURES.items():
            values = [float(figures[name][0, 0]) for figures in each]
            mean = name in ("copper", "current_rms")
            value = float(np.mean(values)) if mean else max(values)
            over = name in limits and value > limits[name] * 1.02  # interpolated designs scatter
            which = "mean of the pressures" if mean else "worst pressure"
            kpis.append(
                Kpi(
                    f"{label}_{name}",
                    value,
                    unit,
                    f"{text.capitalize()}, {which}.",
                    "beyond its limit" if over else "",
                )
            )
        kpis.append(
            Kpi(
                f"{label}_area_ratio",
                ratio,
                "1",
                "Area of the loop on the ramp of eq. (17) over that without dither; delay counts.",
            )
        )
        kpis += _plant(par, label, gain, f, grid.pressures[len(grid.pressures) // 2])
    return kpis


def _plant(par: Par, label: str, gain: float, f: float, p: float) -> list[Kpi]:
    """Return what friction under dither leaves of the plant's gain and speed."""
    dithered = par.replace({"ecu.dither.gain": gain, "ecu.dither.f_dit": f})
    values, note = (math.nan, math.nan), ""
    try:
        plant = dithered_plant(dithered, p)
        values = (plant.gain, plant.slowest)
    except (InputError, RunError) as error:
        note = str(error).partition(":")[0]
    where = f"under dither at {p / 1e5:g} bar, from current demand to pressure."
    return [
        Kpi(f"{label}_plant_gain", values[0], "Pa/A", f"Gain of the plant {where}", note),
        Kpi(f"{label}_plant_pole", values[1], "Hz", f"Slowest pole of the plant {where}", note),
    ]


def _maps(
    data: xr.Dataset, options: Options, designs: dict[str, tuple[float, float]]
) -> dict[str, Map]:
    marks = tuple(Mark(label, gain, f) for label, (gain, f) in designs.items())
    limits = {
        f"stuck more than {100 * options.stuck_max:g} %": ("worst_stuck", options.stuck_max),
        f"ripple above {options.ripple_max / 1e5:g} bar": (
            "worst_ripple_caliper",
            options.ripple_max,
        ),
        "current limit": ("worst_current_share", 1.0),
    }
    low, high = (p / 1e5 for p in (min(options.pressures), max(options.pressures)))
    where = f"worst of {len(options.pressures)} pressures from {low:g} to {high:g} bar"
    return {
        "copper": Map(
            "worst_copper", "gain", "frequency", f"Dither's copper power, {where}.", marks, limits
        ),
        "stuck": Map(
            "worst_stuck",
            "gain",
            "frequency",
            f"Share of the time in which the piston sticks, {where}.",
            marks,
            limits,
        ),
        "ripple": Map(
            "worst_ripple_caliper",
            "gain",
            "frequency",
            f"Pressure ripple at the caliper, peak to peak, {where}.",
            marks,
            limits,
        ),
    }


def _limits(grid: Grid, each: list[Candidate], best: int | None) -> tuple[str, ...]:
    """Return what binds."""
    if best is None:
        return ()
    chosen = each[best]
    texts = [
        f"the gain of {chosen.gain:.3g} is asked for by the {NAMES[chosen.binding]} at "
        f"{grid.pressures[chosen.decisive] / 1e5:g} bar"
    ]
    out = [
        f"{f:.4g} Hz ({e.verdict})"
        for f, e in zip(grid.frequencies, each, strict=True)
        if e.verdict
    ]
    return (*texts, f"frequencies excluded: {', '.join(out)}") if out else tuple(texts)


def _warnings(
    options: Options, grid: Grid, each: list[Candidate], best: int | None
) -> tuple[str, ...]:
    if best is None:
        reasons = {candidate.verdict for candidate in each}
        return (
            f"no dither overcomes the friction within the limits: {'; '.join(sorted(reasons))}",
        )
    texts = []
    f = grid.frequencies[best]
    if best in (0, len(each) - 1):
        texts.append(f"the optimum lies at the edge of the frequencies, {f:g} Hz: widen the range")
    if math.isclose(each[best].gain, options.gain_min):
        texts.append(f"the smallest gain is enough, {options.gain_min:g}: widen the range")
    return tuple(texts)


STUDY = Study(
    name="dither",
    assembly="motorcycle-brake",
    summary="amplitude and frequency of the dither that overcomes the friction at least price",
    options=Options,
    defaults=DEFAULTS,
    compute=compute,
)
