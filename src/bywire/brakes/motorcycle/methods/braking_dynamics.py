"""Transfer function from current to pressure by region (2010, eq. 22, Table 4, Fig. 6)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
import xarray as xr
from pydantic import Field

from bywire.brakes.motorcycle.methods.braking.curves import curves_of
from bywire.brakes.motorcycle.methods.braking.experiment import demands, eq22_of, of_brake, of_eq22
from bywire.brakes.motorcycle.methods.braking.fit import fit, five_of, over_frequency, unknowns_of
from bywire.brakes.motorcycle.methods.braking.records import Region, regions_of
from bywire.brakes.motorcycle.methods.braking.slow_pair import NAMES, response
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Frequency, Pressure, Unit
from bywire.identification.estimate import Estimate
from bywire.identification.measured import joined, split
from bywire.identification.method import Check, Effort, Identified, Method

_MISFIT_STEP, _MISFIT_SINES = 0.05, 0.1


class Options(ParameterSet):
    """Regions, the two steps of the fit, and the synthetic experiment."""

    p_1: Pressure
    """border between low and medium pressure"""
    p_2: Pressure
    """border between medium and high pressure"""
    model: Literal["eq-22", "eq-21"]
    """with a slow pair of a zero and a pole, in either order, or without"""
    fit: Literal["two-step", "joint"]
    """K, tau_L, T_L by the steps and T1, T2 by the sines, in turn; or all by all records"""
    turns: Annotated[int, Unit("1", 20), Field(ge=1, le=200)]
    """turns of the two steps at most; 1 as in the paper"""
    plant: Literal["brake", "eq-22"]
    """synthetic: the whole brake with friction, or a linear one that is eq. (22) exactly"""
    p_low: Pressure
    """synthetic: mean pressure of the low region"""
    p_medium: Pressure
    """synthetic: mean pressure of the medium region"""
    p_high: Pressure
    """synthetic: mean pressure of the high region"""
    i_step: Current
    """synthetic: height of the steps"""
    amplitude: Current
    """synthetic: amplitude of the sines"""
    f_zero: Frequency
    """synthetic eq-22: zero of the slow pair"""
    f_pole: Frequency
    """synthetic eq-22: pole of the slow pair"""
    sigma_p: Annotated[float, Unit("Pa", 2e3), Field(ge=0)]
    """synthetic: noise of the measured pressure"""
    sigma_i: Annotated[float, Unit("A", 5e-3), Field(ge=0)]
    """synthetic: noise of the measured current"""


FREQUENCIES = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0)
"""sines of the synthetic experiment [Hz]"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Return eq. (22) by pressure region.

    Parameters
    ----------
    data
        ``i``: current [A], ``p_mc``: pressure [Pa], both measured through the same filter, whose
        lag then cancels; dither on, or ``ecu.dither.waveform`` off. Several records: in each
        region a step of the current from rest (1 s before, 4 s after it), and sines within 1 and
        15 Hz in steady state, one or several a record. Regions follow from the mean pressure.

    Raises
    ------
    ParameterError
        When a region's records do not tell its unknowns.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 5: eqs. (21), (22), Table 4, Fig. 6.
    """
    dither = par.ecu.dither
    f_dit = None if dither.waveform == "off" else dither.f_dit
    regions = regions_of(split(data), (options.p_1, options.p_2), f_dit)
    estimates: dict[str, Estimate] = {}
    figures: dict[str, tuple[float, str]] = {}
    checks: list[Check] = []
    for k, region in enumerate(regions):
        estimate = fit(
            region,
            par,
            joint=options.fit == "joint",
            turns=round(options.turns),
            pair=options.model == "eq-22",
        )
        estimates[region.name] = estimate
        figures |= _figures(region, estimate)
        checks += _checks(region, estimate)
        if effort.progress is not None:
            effort.progress("regions", (k + 1) / len(regions))
    return Identified(
        estimates=estimates,
        parameters={},
        figures=figures,
        checks=tuple(checks),
        curves=curves_of(regions, estimates, par),
        notes=(*map(_described, regions), *_without_pair(estimates)),
    )


def _without_pair(estimates: Mapping[str, Estimate]) -> tuple[str, ...]:
    names = [region for region, estimate in estimates.items() if not pair_shows(estimate)]
    if not names:
        return ()
    return (
        f"at {' and '.join(names)} pressure a slow pair does not show: set model = 'eq-21', whose "
        "T1 and T2 are then told better",
    )


def pair_shows(estimate: Estimate) -> bool:
    """Return whether the slow pair's zero and pole differ by more than twice what noise makes."""
    names = [u.name for u in estimate.unknowns]
    if not {"tau_L", "T_L"} <= set(names):
        return not {"tau_L", "T_L"} & {k.unknown.name for k in estimate.kept}
    contrast = np.zeros(len(names))
    contrast[names.index("tau_L")], contrast[names.index("T_L")] = 1.0, -1.0
    deviation = math.sqrt(max(float(contrast @ estimate.covariance @ contrast), 0.0))
    return abs(float(contrast @ estimate.values)) > 2.0 * deviation


def _described(region: Region) -> str:
    f = region.points.frequencies
    sines = f"sines at {f.size} frequencies, {f[0]:.3g} to {f[-1]:.3g} Hz" if f.size else "no sines"
    return (
        f"{region.name} pressure, {region.pressure / 1e5:.3g} bar in the mean; step responses: "
        f"{len(region.steps)}; {sines}"
    )


def _figures(region: Region, estimate: Estimate) -> dict[str, tuple[float, str]]:
    """Return the gain, and the corner frequencies as Table 4 has them."""
    five = five_of(estimate)
    figures = {f"{region.name}.K": (five["K"], "Pa/A")}
    for name, T in list(five.items())[1:]:
        figures[f"{region.name}.f_{name}"] = (1.0 / (2.0 * math.pi * T), "Hz")
    return figures


def _checks(region: Region, estimate: Estimate) -> list[Check]:
    """Return how well eq. (22) describes the records."""
    name = region.name
    five = list(five_of(estimate).values())
    rests = [estimate[label] for label in estimate.names if label.endswith(":p_rest")]
    values = np.array([*five, *rests])
    whole = unknowns_of(region, dict(zip(NAMES, five, strict=True)))
    parts = [
        rest + response(values[:5], step.u, step.interval, step.block)[0] - step.pressure
        for rest, step in zip(rests, region.steps, strict=True)
    ]
    noise = np.concatenate([e / s.sigma for e, s in zip(parts, region.steps, strict=True)])
    error = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
    change = max(float(np.ptp(step.pressure)) for step in region.steps)
    checks = [
        Check(
            f"{name}.misfit_step",
            error / change,
            limit=_MISFIT_STEP,
            note="step: rms of computed less measured over the change",
        ),
        Check(
            f"{name}.step_residual_over_noise",
            float(np.sqrt(np.mean(noise**2))),
            note="about 1 where nothing but noise is left",
        ),
    ]
    if region.points.frequencies.size:
        e, _ = over_frequency(region, whole).evaluate(values)
        size = e * np.repeat(region.points.deviation, 2)
        checks.append(
            Check(
                f"{name}.misfit_sines",
                float(np.sqrt(np.mean(size**2))),
                limit=_MISFIT_SINES,
                note="sines: rms of relative magnitude and phase [rad], computed less measured",
            )
        )
    return checks


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return steps and sines in all three regions, simulated, with the sensors' noise."""
    pressures = _pressures(options)
    changes = demands(options.i_step, options.amplitude, FREQUENCIES)
    noise = (options.sigma_p, options.sigma_i, seed)
    if options.plant == "brake":
        return joined(of_brake(par, pressures, changes, *noise))
    models = {
        name: (p, eq22_of(par, p, options.f_zero, options.f_pole)) for name, p in pressures.items()
    }
    return joined(of_eq22(models, par, changes, *noise))


def _pressures(options: Options) -> dict[str, float]:
    return {"low": options.p_low, "medium": options.p_medium, "high": options.p_high}


def truth(par: MotorcycleParameters, options: Options) -> Mapping[str, float]:
    """Return what the linear synthetic brake has; the whole brake is no eq. (22)."""
    if options.plant == "brake":
        raise ParameterError(
            "the whole brake has no true values of eq. (22): set plant = 'eq-22' to study what "
            "the method gives back of what is put in"
        )
    values = {}
    for region, p in _pressures(options).items():
        model = eq22_of(par, p, options.f_zero, options.f_pole)
        pole, slow, fast = sorted(model.poles_hz)
        corners = {"tau_L": float(model.zeros_hz[0]), "T1": slow, "T2": fast, "T_L": pole}
        values[f"{region}:K"] = model.gain
        for name, f in corners.items():
            values[f"{region}:{name}"] = 1.0 / (2.0 * math.pi * float(f))
    return values


METHOD = Method(
    name="braking-dynamics",
    assembly="motorcycle-brake",
    summary="transfer function from current to pressure by region (2010, eq. 22, Table 4, Fig. 6)",
    experiment="pressure-step",
    signals={"i": "A", "p_mc": "Pa"},
    options=Options,
    defaults=Options(
        p_1=10e5,
        p_2=35e5,
        model="eq-22",
        fit="joint",
        turns=20,
        plant="brake",
        p_low=5e5,
        p_medium=25e5,
        p_high=37e5,
        i_step=0.35,
        amplitude=0.1,
        f_zero=0.096,
        f_pole=0.104,
        sigma_p=2e3,
        sigma_i=5e-3,
    ),
    identify=identify,
    synthetic=synthetic,
    several=True,
    simulated=(
        "plant",
        "p_low",
        "p_medium",
        "p_high",
        "i_step",
        "amplitude",
        "f_zero",
        "f_pole",
        "sigma_p",
        "sigma_i",
    ),
    truth=truth,
    further={
        "K": ("Pa/A", "gain from current to pressure, in each region"),
        "tau_L": ("s", "zero of the slow pair"),
        "T_L": ("s", "pole of the slow pair"),
        "T1": ("s", "slower pole of the drive"),
        "T2": ("s", "faster pole of the drive"),
        "p_rest": ("Pa", "pressure before a step, for each step"),
    },
)
