"""Fault campaign of the wedge brake, which holds a moment, reduces it, then ramps it up."""

from __future__ import annotations

from bywire.campaigns.residual import DeclaredCampaign

CAMPAIGN = DeclaredCampaign(
    "wedge",
    "every fault of the wedge brake while it holds a moment, at four onset times",
    {
        "bench": "moment-ramp",
        "vary": {
            "wedge.mu_B": "+-5 %",
            "caliper.K_cal": "+-10 %",
            "bearing.C_0": "+-20 %",
            "heart.g_1": "+-20 %",
            "heart.g_2": "+-20 %",
            "motor_1.R_ref": "+-10 %",
            "motor_2.R_ref": "+-10 %",
        },
        "campaign": {
            "onset": "0.3 s",
            "spread": "20 ms",
            "onsets": 4,
            "healthy": 256,
            "present": ["caliper.gap-grown", "caliper.pad-lost", "heart.worn"],
            "leave_out": ["theta_?_set.*", "i_?_set.*"],
        },
        "values": {
            "moment.stuck": ["0 N*m", "100 N*m", "300 N*m"],
            "moment.offset": ["-50 N*m", "50 N*m"],
            "wedge.friction": [0.5, 1.5],
        },
        "criteria": [
            {
                "name": "loss of braking",
                "signal": "M_B",
                "below_share": "80 %",
                "lasting": "100 ms",
            },
            {
                "name": "unintended braking",
                "signal": "M_B",
                "above_healthy": "60 N*m",
                "lasting": "50 ms",
            },
        ],
    },
)
