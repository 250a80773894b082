"""Equation (8)'s gear, which creates energy when the load drives it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from bywire.brakes.motorcycle.paper.runs import FRICTIONLESS, MAIN, SETS, Runs, parameters
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.report.energy_balance import energy_balance
from bywire.reproduction.item import Fact, Item, compared, found
from bywire.reproduction.reproduction import Exhibit, Part, selected

if TYPE_CHECKING:
    import xarray as xr

P_FROM = 37e5
"""pressure at which the release begins [Pa], as in Fig. 7a"""
T_RELEASE = 200.0
"""duration of the release [s]: slow compared with every pole, so that damping losses vanish"""
MECHANICAL = {
    "E_gear": "gear and screw",
    "E_damping": "fluid damping",
    "E_pipeline": "pipeline",
    "E_stored": "stored",
}
LAWS = ("paper", "directional")


def part(runs: Runs) -> Part:
    """Return the energy that a slow release returns, for both gear laws."""
    items: list[Item] = []
    for name, suffix in SETS.items():
        for law in LAWS:
            items += _items(_release(runs, name, law), law, suffix)
        pads = _pad_energy(parameters(name))
        items.append(
            found(
                f"gear.stored.pads{suffix}",
                "J",
                pads,
                "energy stored in the pads alone: (A_pd p)^2/(2 K_pd)",
            )
        )
    par = parameters(MAIN)
    text = (
        "Eq. (8) multiplies the motor's torque by a constant efficiency. While the motor drives, "
        "this is a loss. While the load drives the shaft backward, it is a gain: the motor "
        f"receives 1/eta_g times the stored energy (eta_g = {par.gear.eta_g:g}). The catalog uses "
        "the paper's law. gear.law = 'directional' makes the loss a friction that depends on "
        "direction."
    )
    releases = {law: _release(runs, MAIN, law) for law in LAWS}
    caption = (
        "Mechanical energy of a slow release from 37 bar without dry friction, law '{}'. The "
        "source is the motor's shaft."
    )
    exhibits = tuple(
        Exhibit(
            f"gear-{law}",
            partial(energy_balance, release, source="W_shaft", sinks=MECHANICAL),
            caption.format(law),
        )
        for law, release in releases.items()
    )
    kept = {
        f"gear-{law}": selected(release, "i", "p_mc", "x_mc", "W_shaft", "E_gear", "E_stored")
        for law, release in releases.items()
    }
    return Part("Equation (8): the gear", text, tuple(items), exhibits, kept)


def _items(release: xr.Dataset, law: str, suffix: str) -> list[Item]:
    """Return the stored and the returned energy."""
    stored, returned = _energies(release)
    bound = Fact(
        stored,
        "J",
        "physical bound: the returned energy cannot exceed the stored energy; our computation",
        "physical bound",
    )
    note = f"law '{law}', {'eq. (8)' if law == 'paper' else 'ours'}"
    return [
        found(f"gear.stored.{law}{suffix}", "J", stored, f"at 37 bar, without friction, {note}"),
        compared(
            f"gear.returned.{law}{suffix}",
            bound,
            returned,
            "<=",
            f"work at the motor's shaft during a slow release, {100.0 * returned / stored:.1f} % "
            f"of the stored energy, {note}",
        ),
    ]


def _pad_energy(par: MotorcycleParameters) -> float:
    force = par.caliper.A_pd * P_FROM
    return 0.5 * force * force / par.caliper.K_pd


def _release(runs: Runs, name: str, law: str) -> xr.Dataset:
    """Return the recording of a slow release with an ideal current source."""
    overrides = {**FRICTIONLESS, "gear.law": law}
    i = holding_current(P_FROM, parameters(name).replace({"gear.law": law}))
    stimulus = {
        "kind": "ramp",
        "start": i,
        "end": 0.0,
        "slope": i / T_RELEASE,
        "t_start": 0.0,
        "t_hold": 0.0,
        "after": "stay",
    }
    options = {"source": "current", "p_start": P_FROM, "duration": T_RELEASE, "record": 0.1}
    return runs.bench("motor-open-loop", name, overrides, options, stimulus).recordings["run"]


def _energies(release: xr.Dataset) -> tuple[float, float]:
    """Return the energy stored at the start minus that at the end, and the work returned [J]."""
    stored, work = release["E_stored"].values, release["W_shaft"].values
    return float(stored[0] - stored[-1]), float(work[0] - work[-1])
