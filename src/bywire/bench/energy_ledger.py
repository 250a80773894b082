"""Where the energy of a run came from and where it went, from its recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

BRAKE_SOURCES = {"E_source": "source"}
BRAKE_SINKS = {
    "E_copper_moving": "copper, moving",
    "E_copper_holding": "copper, holding",
    "E_copper": "copper",
    "E_gear": "gear and screw",
    "E_seal": "seal friction",
    "E_damping": "fluid damping",
    "E_pipeline": "pipeline",
    "E_supply": "supply",
    "E_stop": "end stops",
    "E_port": "reservoir port",
    "E_stored": "stored",
}
"""energies of the motorcycle brake: integrals over the run, and what is stored"""

WEDGE_SOURCES = {
    "W_supply": "supply",
    "W_electric": "electrical",
    "W_disc": "disc on wedge",
    "W_runout": "run-out",
}
WEDGE_SINKS = {
    "E_standby": "standby of the drives",
    "E_copper_moving": "copper, moving",
    "E_copper_holding": "copper, holding",
    "E_copper": "copper",
    "E_shaft": "bearings and screws",
    "E_wedge": "friction on the wedge",
    "E_damping": "motor damping",
    "E_heart": "brake heart",
    "E_caliper": "caliper damping",
    "E_line": "damping of screws and sensor",
    "E_stop": "end stops",
    "E_stored": "stored",
}
"""energies of the wedge brake and its rigs; of a whole, the parts count where they are known"""

DISC_SOURCES = {"W_brake": "disc", "W_supply": "supply", "W_runout": "run-out"}
DISC_SINKS = {"E_pads": "heat of pads and disc"} | WEDGE_SINKS
"""the wedge brake with its disc: nearly everything becomes heat where the pads rub"""

_PARTS = {
    "E_copper": ("E_copper_moving", "E_copper_holding"),
    "W_electric": ("W_supply",),
}  # what counts in place of a whole


@dataclass(frozen=True)
class Posting:
    """What one place gave or took.

    Parameters
    ----------
    name, label
        Variable, and what people read.
    energy
        In J, signed: a source that takes energy back and a loss below zero are negative.
    """

    name: str
    label: str
    energy: float


@dataclass(frozen=True)
class Ledger:
    """Sources and sinks of energy over a recording."""

    sources: tuple[Posting, ...]
    sinks: tuple[Posting, ...]

    @property
    def turnover(self) -> float:
        """Energy that was given by all that gave [J]."""
        given = sum(max(one.energy, 0.0) for one in self.sources)
        return given + sum(max(-one.energy, 0.0) for one in self.sinks)

    @property
    def closing_error(self) -> float:
        """What the sources gave less what the sinks took [J]: the error of the books."""
        given = sum(one.energy for one in self.sources)
        return given - sum(one.energy for one in self.sinks)


def actuator_ledger(recording: xr.Dataset) -> Ledger:
    """Return the books of an actuator or rig, between the ends of a recording.

    Parameters
    ----------
    recording
        Recording with energies [J]; losses that no brake of ours has keep their own labels.
    """
    is_wedge = "E_shaft" in recording.data_vars
    sources = WEDGE_SOURCES if "W_disc" in recording.data_vars else BRAKE_SOURCES
    sinks = WEDGE_SINKS if is_wedge else BRAKE_SINKS
    return ledger(recording, sources, sinks | _others(recording, sinks))


def disc_ledger(recording: xr.Dataset) -> Ledger | None:
    """Return the books of brake and disc together; None where no disc is braked.

    The disc loses the braking moment's work; what the pad that moves with the wedge hands on to
    it is no heat, so that the pads and the disc keep the rest.
    """
    if "W_brake" not in recording.data_vars:
        return None
    return ledger(recording, DISC_SOURCES, DISC_SINKS)


def ledger(
    recording: xr.Dataset, sources: Mapping[str, str], sinks: Mapping[str, str]
) -> Ledger:
    """Return the books of some variables.

    Parameters
    ----------
    recording
        Recording with energies [J]; of each the difference between end and start counts.
    sources, sinks
        Label by variable. What a recording lacks is left out, and a whole whose parts are there.
    """
    changes = _changes(recording)

    def posted(wanted: Mapping[str, str]) -> tuple[Posting, ...]:
        known = [name for name in wanted if name in changes]
        whole = [name for name in known if all(part in known for part in _PARTS.get(name, ("",)))]
        return tuple(
            Posting(name, wanted[name], changes[name]) for name in known if name not in whole
        )

    return Ledger(posted(sources), posted(sinks))


def _others(recording: xr.Dataset, sinks: Mapping[str, str]) -> dict[str, str]:
    """Return the losses of other actuators, as their recording calls them."""
    known = {*sinks, *BRAKE_SOURCES}
    names = [str(key) for key in recording.data_vars]
    found = [name for name in names if name.startswith("E_") and name not in known]
    return {name: str(recording[name].attrs.get("long_name", name)) for name in found}


def _changes(recording: xr.Dataset) -> dict[str, float]:
    """Return what every energy grew by [J], with those that follow from others."""
    found = {}
    for key in recording.data_vars:
        name, values = str(key), recording[key].values
        if name.startswith(("E_", "W_")) and values.ndim == 1:
            found[name] = float(values[-1] - values[0])
    if {"W_supply", "W_electric"} <= found.keys():
        found["E_standby"] = found["W_supply"] - found["W_electric"]
    if {"W_brake", "W_disc"} <= found.keys():
        found["E_pads"] = found["W_brake"] - found["W_disc"]
    if "E_copper" in found and "t_stuck" in recording:
        found["E_copper_holding"] = _while_stuck(recording, "E_copper")
        found["E_copper_moving"] = found["E_copper"] - found["E_copper_holding"]
    return found


def _while_stuck(recording: xr.Dataset, name: str) -> float:
    """Return how much an energy grew while all stuck [J]: evenly within each recorded interval."""
    names = (name, "t_stuck", "time")
    energy, stuck, time = (np.diff(recording[one].values) for one in names)
    return float(np.sum(energy * np.clip(stuck / time, 0.0, 1.0)))
