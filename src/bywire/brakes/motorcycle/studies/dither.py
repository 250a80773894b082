"""Dither for the motorcycle brake: cheapest amplitude and frequency that overcome friction."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
import xarray as xr
from pydantic import Field, model_validator

from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.motorcycle.dither import (
    FIGURES,
    NAMES,
    Candidate,
    Grid,
    Trial,
    admissible_frequencies,
    area_ratios,
    attenuation,
    best_of,
    by_frequency,
    by_pressure,
    candidates,
    dithered_plant,
    figures_of,
    law,
    mapped,
    reach,
    tried,
    waveform,
)
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import highest_pressure
from bywire.core.errors import InputError, RunError, not_valid
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Factor, Fraction, Frequency, Pressure, Unit
from bywire.core.typing import Progress
from bywire.synthesis.study import Cut, Findings, Map, Mark, Study, require_ranges, variable

Count = Annotated[int, Unit("1", 8.0), Field(ge=3, le=101)]
Node = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Pressures = Annotated[tuple[Node, ...], Unit("Pa", 2e6), Field(min_length=1, max_length=20)]

ASSUMPTIONS = (
    "Each dither is tried on the nonlinear brake with a closed pressure loop, which approaches "
    "the set point from below and from above.",
    "The amplitude is the gain times the ECU's eqs. (18) and (19), so it follows the pressure.",
    "Friction is considered overcome when the fraction of time stuck and the remaining dead band "
    "stay within their limits at this gain and at all higher gains. The remaining dead band is the "
    "mean current when approaching from above minus the mean current when approaching from below, "
    "relative to the band in which the piston may rest.",
    "The cost is the copper loss in excess of the mean current's, averaged over the pressures. "
    "Key figures between two gains of the grid are interpolated.",
    "Dither periods are even numbers of ECU sample times.",
    "The study neglects wear, noise, and heat in motor and seals.",
)


class Options(ParameterSet):
    """Pressures, dithers and limits."""

    pressures: Pressures
    """pressures at which dither must overcome friction"""
    gain_min: Factor
    """minimum dither gain"""
    gain_max: Factor
    """maximum dither gain"""
    gains: Count
    """number of gains, evenly spaced"""
    f_min: Frequency
    """lowest dither frequency"""
    f_max: Frequency
    """highest dither frequency"""
    frequencies: Count
    """number of frequencies, approximately logarithmically spaced"""
    stuck_max: Fraction
    """maximum fraction of time during which the piston is stuck"""
    band_max: Fraction
    """maximum fraction of the dead band that may remain"""
    ripple_max: Pressure
    """maximum peak-to-peak ripple of the caliper pressure"""
    approach: Pressure
    """pressure difference from which the pressure loop approaches each pressure"""
    settle: Duration
    """time for the pressure loop to settle"""
    compare: Literal["waveforms", "none"]
    """whether to compare waveforms and positions of the low-pass filter"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        require_ranges(self, (("gain_min", "gain_max", "1"), ("f_min", "f_max", "Hz")))
        if any(not a < b for a, b in pairwise(self.pressures)):
            shown = ", ".join(f"{p / 1e5:g} bar" for p in self.pressures)
            raise RuleError("pressures", shown, "increasing, without repetition")
        lowest = min(self.pressures)
        if not self.approach < lowest:
            raise RuleError(
                "approach",
                f"{self.approach / 1e5:g} bar",
                f"below the lowest of the pressures, {lowest / 1e5:g} bar",
                "the approach from below starts there",
            )
        return self


DEFAULTS = Options(
    pressures=(5e5, 20e5, 35e5),
    gain_min=0.5,
    gain_max=2.25,
    gains=8,
    f_min=20.0,
    f_max=100.0,
    frequencies=8,
    stuck_max=0.1,
    band_max=0.05,
    ripple_max=0.5e5,
    approach=2e5,
    settle=4.0,
    compare="waveforms",
)


Par = MotorcycleParameters

# Comparison of sine, square and triangle, through the demand's filter or bypassing it.

WAVEFORMS = ("sine", "square", "triangle")
PLACES = ("after-dither", "before-dither")
_UNITS = {"distortion": "%", "copper": "W", "ripple_caliper": "Pa"}


def compared(
    par: Par, grid: Grid, f: float, limits: Mapping[str, float], report: Callable[[float], None]
) -> Cut:
    """Return each waveform's lowest gain that overcomes the friction at one frequency [Hz].

    This gain is sufficient at every pressure. Copper loss is the mean of the pressures, ripple is
    the maximum.
    """
    cases = [(shape, place) for place in PLACES for shape in WAVEFORMS]
    rows: list[dict[str, Any]] = []
    for k, (shape, place) in enumerate(cases):
        shaped = par.replace({"ecu.dither.waveform": shape, "ecu.filter.place": place})
        rows.append({"waveform": shape, "filter": place, **_row(shaped, grid, f, limits)})
        report((k + 1) / len(cases))
    index = np.arange(len(rows))
    table = xr.Dataset(
        {
            name: variable(
                np.array([row[name] for row in rows]), ("case",), _UNITS.get(name, "1"), name
            )
            for name in rows[0]
        },
        coords={"case": ("case", index)},
    )
    return Cut(
        f"waveforms at {f:.4g} Hz, with the filter after or before the dither is added",
        table,
        tuple(rows[0]),
    )


def distortion(par: Par, f: float, p: float) -> float:
    """Return the motor current's total harmonic distortion with a stuck shaft, in %.

    The sum ends at half the ECU's sampling rate. Beyond it, the hold and the winding attenuate
    strongly.
    """
    samples = waveform(par, f)
    orders = np.arange(1, (samples.size + 1) // 2)
    passed = attenuation(par, np.asarray(orders * f, dtype=np.float64), p)
    size = np.abs(np.fft.rfft(samples)[orders]) * np.abs(passed)
    return float(100.0 * np.sqrt(np.sum(size[1:] ** 2)) / size[0])


def _row(par: Par, grid: Grid, f: float, limits: Mapping[str, float]) -> dict[str, Any]:
    gains = np.asarray(grid.gains)
    middle = grid.pressures[len(grid.pressures) // 2]
    columns = [tried(par, p, grid.gains, (f,), grid.trial) for p in grid.pressures]
    candidate = candidates(gains, columns, limits)[0]
    return {
        "reach": reach(par, f, middle),
        "distortion": distortion(par, f, middle),
        "gain": candidate.gain,
        "copper": candidate.price,
        "ripple_caliper": candidate.ripple,
        "limit": candidate.verdict or "none",
    }


def compute(par: Par, options: Options, progress: Progress) -> Findings:
    """Return figures versus gain and frequency, the cheapest dither, and its comparison.

    Raises
    ------
    ParameterError
        When the brake cannot reach a pressure, or no frequency fits the ECU's sampling.
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
    """Return the maximum admissible value of every figure that has one."""
    return {
        "stuck": options.stuck_max,
        "band": options.band_max,
        "ripple_caliper": options.ripple_max,
        "current_share": 1.0,
        "duty_share": 1.0,
    }


def _require_reachable(par: Par, options: Options) -> None:
    highest, largest = highest_pressure(par), max(options.pressures)
    if not largest + options.approach < highest:
        raise not_valid(
            "pressures",
            f"{largest / 1e5:g} bar",
            f"< {(highest - options.approach) / 1e5:.4g} bar",
            f"because the piston reaches its end stop at {highest / 1e5:.4g} bar and the "
            f"approach from above starts {options.approach / 1e5:g} bar above the pressure",
        )


def _kpis(
    par: Par, options: Options, grid: Grid, designs: dict[str, tuple[float, float]]
) -> list[Kpi]:
    """Return the key figures of each design, measured on the bench without interpolation."""
    ratios = area_ratios(par, list(designs.values()))
    kpis = []
    for (label, (gain, f)), ratio in zip(designs.items(), ratios, strict=True):
        figures_of_design = [tried(par, p, (gain,), (f,), grid.trial) for p in grid.pressures]
        kpis += [
            Kpi(f"{label}_gain", gain, "1", "Dither gain, eqs. (18) and (19)."),
            Kpi(f"{label}_frequency", f, "Hz", "Frequency of the dither."),
        ]
        limits = limits_of(options)
        for name, (unit, text) in FIGURES.items():
            values = [float(figures[name][0, 0]) for figures in figures_of_design]
            mean = name in ("copper", "current_rms")
            value = float(np.mean(values)) if mean else max(values)
            over = name in limits and value > limits[name] * 1.02  # designs are interpolated
            which = "mean of the pressures" if mean else "worst pressure"
            kpis.append(
                Kpi(
                    f"{label}_{name}",
                    value,
                    unit,
                    f"{text.capitalize()}, {which}.",
                    "exceeds its limit" if over else "",
                )
            )
        kpis.append(
            Kpi(
                f"{label}_area_ratio",
                ratio,
                "1",
                "Loop area on the ramp of eq. (17) relative to that without dither, including "
                "delay.",
            )
        )
        kpis += _plant(par, label, gain, f, grid.pressures[len(grid.pressures) // 2])
    return kpis


def _plant(par: Par, label: str, gain: float, f: float, p: float) -> list[Kpi]:
    """Return gain and slowest pole of the plant with dither."""
    dithered = par.replace({"ecu.dither.gain": gain, "ecu.dither.f_dit": f})
    values, note = (math.nan, math.nan), ""
    try:
        plant = dithered_plant(dithered, p)
        values = (plant.gain, plant.slowest)
    except (InputError, RunError) as error:
        note = str(error).partition(":")[0]
    where = f"with dither at {p / 1e5:g} bar, from current demand to pressure."
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
            "worst_copper", "gain", "frequency", f"Copper loss from dither, {where}.", marks, limits
        ),
        "stuck": Map(
            "worst_stuck",
            "gain",
            "frequency",
            f"Fraction of time during which the piston sticks, {where}.",
            marks,
            limits,
        ),
        "ripple": Map(
            "worst_ripple_caliper",
            "gain",
            "frequency",
            f"Peak-to-peak pressure ripple at the caliper, {where}.",
            marks,
            limits,
        ),
    }


def _limits(grid: Grid, each: list[Candidate], best: int | None) -> tuple[str, ...]:
    """Return the decisive limits."""
    if best is None:
        return ()
    chosen = each[best]
    texts = [
        f"the {NAMES[chosen.binding]} at {grid.pressures[chosen.decisive] / 1e5:g} bar requires "
        f"a gain of {chosen.gain:.3g}"
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
        texts.append(
            f"the optimum is at the limit of the frequency range, {f:g} Hz. Widen the range"
        )
    if math.isclose(each[best].gain, options.gain_min):
        texts.append(f"the lowest gain, {options.gain_min:g}, is sufficient. Widen the range")
    return tuple(texts)


STUDY = Study(
    name="dither",
    assembly="motorcycle-brake",
    summary="amplitude and frequency of the lowest-loss dither that overcomes friction",
    options=Options,
    defaults=DEFAULTS,
    compute=compute,
)
