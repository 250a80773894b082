"""A recording like that of a hard braking, generated without a simulation."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.bench.energy_ledger import role_attributes
from bywire.core.signals import Role

LABELS = {
    "p_mc": ("Pa", "master-cylinder pressure"),
    "p_pd": ("Pa", "caliper pressure"),
    "p_ref": ("Pa", "pressure set point"),
    "i": ("A", "motor current"),
    "i_ref": ("A", "current set point"),
    "i_star": ("A", "current demand"),
    "omega": ("rad/s", "motor speed"),
    "duty": ("1", "duty cycle"),
    "P_el": ("W", "electrical power from battery or source"),
    "stuck": ("1", "shaft stuck"),
    "sat_current": ("1", "current demand saturated"),
    "sat_duty": ("1", "duty cycle saturated"),
}
SHARES = {
    "E_source": 1.0,
    "E_supply": 0.04,
    "E_copper": 0.52,
    "E_gear": -0.03,
    "E_seal": 0.15,
    "E_damping": 0.08,
    "E_pipeline": 0.06,
    "E_stop": 0.0,
    "E_port": 0.0,
    "E_stored": 0.18,
}
ROLES = {
    "E_source": Role("source", "source"),
    "E_supply": Role("sink", "supply"),
    "E_copper": Role("sink", "copper"),
    "E_gear": Role("sink", "gear and screw"),
    "E_seal": Role("sink", "seal friction"),
    "E_damping": Role("sink", "fluid damping"),
    "E_pipeline": Role("sink", "pipeline"),
    "E_stop": Role("sink", "end stops"),
    "E_port": Role("sink", "reservoir port"),
    "E_stored": Role("sink", "stored"),
}


def pressure_step(duration: float = 1.2, sample_time: float = 1e-3) -> xr.Dataset:
    """Return a second-order pressure step from 6 to 37 bar at 0.1 s, with a 50 Hz ripple."""
    time = np.arange(round(duration / sample_time) + 1) * sample_time
    since = np.clip(time - 0.1, 0.0, None)
    damping, w = 0.55, 2.0 * np.pi * 6.0
    damped = w * np.sqrt(1.0 - damping**2)
    wave = np.cos(damped * since) + damping * w / damped * np.sin(damped * since)
    ripple = np.sin(2.0 * np.pi * 50.0 * time)
    p = 6e5 + 31e5 * (1.0 - np.exp(-damping * w * since) * wave) + 2e4 * ripple
    i = np.clip(p / 10.1e5 + 9.6 * np.exp(-10.0 * since) * (time > 0.1), None, 9.6) + 0.3 * ripple
    omega = np.gradient(p, sample_time) / 1e5
    power = 0.96 * i**2
    values = {
        "p_mc": p,
        "p_pd": 0.98 * p,
        "p_ref": np.where(time > 0.1, 37e5, 6e5),
        "i": i,
        "i_ref": 1.02 * i,
        "i_star": i - 0.3 * ripple,
        "omega": omega,
        "duty": np.clip(0.08 * i + 0.004 * omega, -1.0, 1.0),
        "P_el": power,
        "stuck": np.abs(omega) < 8.0,
        "sat_current": i > 9.5,
        "sat_duty": np.abs(omega) > 400.0,
    }
    energy = np.cumsum(power) * sample_time
    energies = {name: ("J", share * energy) for name, share in SHARES.items()}
    entries = {name: (*LABELS[name], value) for name, value in values.items()} | {
        name: (unit, name, value) for name, (unit, value) in energies.items()
    }
    return xr.Dataset(
        {
            name: (
                "time",
                np.asarray(value, dtype=float),
                {"units": unit, "long_name": label} | role_attributes(ROLES.get(name)),
            )
            for name, (unit, label, value) in entries.items()
        },
        coords={"time": time},
        attrs={"bywire_version": "0.1.0", "experiment": "hard-braking", "status": "ok"},
    )


@pytest.fixture(scope="session")
def recording() -> xr.Dataset:
    """1.2 s of hard braking."""
    return pressure_step()


@pytest.fixture(scope="session")
def curve() -> xr.Dataset:
    """Dry friction over speed, rest included as -0 and +0, at 2 and 20 bar."""
    side = np.linspace(0.0, 2.0, 41)
    sign = np.repeat([-1.0, 1.0], side.size)
    torque = [sign * (2e-3 + 1.6e-8 * p) for p in (2e5, 20e5)]
    return xr.Dataset(
        {"T_fr": (("p_mc", "omega"), torque, {"units": "N*m", "long_name": "friction torque"})},
        coords={
            "p_mc": ("p_mc", [2e5, 20e5], {"units": "Pa"}),
            "omega": (
                "omega",
                np.append(-side[::-1], side),
                {"units": "rad/s", "long_name": "speed"},
            ),
        },
    )


@pytest.fixture(scope="session")
def long_recording() -> xr.Dataset:
    """60 s at 1 kHz."""
    return pressure_step(60.0)
