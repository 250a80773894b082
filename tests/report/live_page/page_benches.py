"""Benches whose pages are tried, in Node and in a browser."""

import bywire

SHORT = {"t_hold": "60 ms", "pulses": 1, "t_low": "20 ms", "t_high": "20 ms", "settle": "20 ms"}
BENCHES = {
    "motorcycle": bywire.Bench(
        "hard-braking", "dardanelli2010", overrides={"adc.noise": 0.0},
        options={"settle": 0.1, "duration": 0.3}, requirements={"overshoot": "<= 15 %"},
    ),
    "wedge": bywire.Bench("moment-pulses", "roberts2003", options=SHORT),
}  # fmt: skip
VARIED = {
    "motorcycle": ("motor.R_m", "seal.T_pr", "caliper.K_pd", "fluid.beta"),
    "wedge": ("wedge.mu_B", "motor_1.R_ref", "heart.K_W", "caliper.K_cal"),
}
