"""Fault campaign of the two-wheeler, an emergency stop on wet asphalt with slip control."""

from __future__ import annotations

from bywire.campaigns.residual import DeclaredCampaign

CAMPAIGN = DeclaredCampaign(
    "two-wheeler",
    "every fault of the two-wheeler during an emergency stop on wet asphalt",
    {
        "bench": "straight-stop",
        "set": {"options.surface": "wet-asphalt", "options.duration": "6 s"},
        "vary": {
            "vehicle.body.m": "+-10 %",
            "front.disc.mu_pad": "+-10 %",
            "rear.disc.mu_pad": "+-10 %",
            "front.circuit.f_n": "+-10 %",
            "sensors.a_offset": {"kind": "normal", "sd": "0.1 m/s**2"},
        },
        "campaign": {
            "onset": "0.8 s",
            "spread": "0.8 s",
            "onsets": 4,
            "healthy": 256,
            "present": ["front.disc.*", "rear.disc.*", "front.circuit.*", "rear.circuit.*"],
        },
        "values": {"front.stuck": ["0 bar", "40 bar"], "rear.stuck": ["0 bar", "40 bar"]},
        "criteria": [
            {"name": "longer stop", "signal": "v", "above_healthy": "2 m/s", "lasting": "0.2 s"},
            {
                "name": "front wheel locks",
                "signal": "v_f",
                "below_healthy": "8 m/s",
                "lasting": "0.1 s",
            },
            {
                "name": "rear wheel locks",
                "signal": "v_r",
                "below_healthy": "8 m/s",
                "lasting": "0.1 s",
            },
        ],
    },
)
