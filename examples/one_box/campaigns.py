"""Fault campaigns: every fault during an application, and during a stop on a wet road."""

from __future__ import annotations

from bywire.authoring import DeclaredCampaign

APPLY = DeclaredCampaign(
    "one-box",
    "every fault of the one-box brake while the pedal is pressed",
    {
        "bench": "pedal-apply",
        "set": {"options.t_hold": "2 s", "options.t_end": "1 ms"},
        "vary": {"others.c": "+-10 %", "caliper.c": "+-10 %", "motor.K_e": "+-5 %"},
        "campaign": {
            "onset": "0.5 s",
            "spread": "0.1 s",
            "onsets": 2,
            "healthy": 64,
            "leave_out": ["*_set.*"],
        },
        "criteria": [
            {"name": "loss of braking", "signal": "p", "below_share": "80 %", "lasting": "50 ms"},
            {
                "name": "unintended braking",
                "signal": "p",
                "above_healthy": "10 bar",
                "lasting": "50 ms",
            },
        ],
    },
)
STOP = DeclaredCampaign(
    "one-box-stop",
    "every fault of the one-box brake during a stop with anti-lock control on wet asphalt",
    {
        "bench": "abs-stop",
        "vary": {"disc.mu_pad": "+-10 %", "corner.body.m": "+-10 %", "caliper.c": "+-10 %"},
        "campaign": {
            "onset": "1 s",
            "spread": "0.5 s",
            "onsets": 2,
            "healthy": 64,
            "leave_out": [
                "F_foot.*",
                "theta_set.*",
                "i_set.*",
                "close_set.*",
                "release_set.*",
                "pump_set.*",
                "travel.*",
            ],
        },
        "criteria": [
            {"name": "longer stop", "signal": "v_x", "above_healthy": "2 m/s", "lasting": "0.3 s"},
            {
                "name": "wheel locks",
                "signal": "v_tread",
                "below_healthy": "8 m/s",
                "lasting": "0.2 s",
            },
        ],
    },
)
