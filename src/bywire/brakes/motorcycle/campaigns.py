"""Fault campaign of the motorcycle brake: full braking, held at 37 bar."""

from __future__ import annotations

from bywire.campaigns.residual import DeclaredCampaign

CAMPAIGN = DeclaredCampaign(
    "motorcycle",
    "every failure of the motorcycle brake during full braking, at eight phases of its dither",
    {
        "bench": "hard-braking",
        "set": {"options.p_from": "1 Pa", "options.p_to": "37 bar", "options.duration": "2.5 s"},
        "vary": {
            "motor.R_m": "+-10 %",
            "motor.K_e": "+-5 %",
            "seal.T_pr": "+-20 %",
            "caliper.K_pd": "+-10 %",
            "supply.V_bat": "+-10 %",
        },
        "campaign": {
            "onset": "0.8 s",
            "spread": "20 ms",
            "onsets": 8,
            "healthy": 256,
            "present": ["fluid.*", "caliper.knocked-back", "piston.*"],
            "leave_out": ["pedal_force.*", "i_set.*", "v_set.*"],
        },
        "values": {
            "pressure.stuck": ["0 bar", "20 bar", "50 bar"],
            "pressure.offset": ["-5 bar", "-2 bar", "2 bar", "5 bar"],
            "pressure.drift": ["-1 bar/s", "1 bar/s"],
            "bridge.stuck": [-1, 0, 0.5, 1],
            "seal.swollen": [1.9, 3],
            "caliper.leaking": ["1e-14 m**3/(s*Pa)", "1e-13 m**3/(s*Pa)", "1e-12 m**3/(s*Pa)"],
            "ecu.dropped": [2, 5],
        },
        "criteria": [
            {
                "name": "loss of braking",
                "signal": "p_pd",
                "below_share": "80 %",
                "lasting": "50 ms",
            },
            {
                "name": "unintended braking",
                "signal": "p_pd",
                "above_healthy": "5 bar",
                "lasting": "50 ms",
            },
        ],
        "reaction": {"fault": "bridge.open-phase", "delay": "10 ms"},
    },
)
