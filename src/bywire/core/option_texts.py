"""What can be asked of a use case, in words: help of a command's option and of a form's field.

Named after the option; where commands say different things of one, after the command too.
"""

from __future__ import annotations

from typing import Final

# What many share.
AT: Final = "Operating point, e.g. '20 bar'."
BENCH_CHANGES: Final = "Change the bench, e.g. motor.R_m=0.4ohm."
CASE: Final = "Run of the experiment; the first by default."
CHANGES: Final = "Change a parameter, e.g. motor.R_m=0.4ohm."
ERROR_ESTIMATE: Final = "Run in other steps too, for the error of all figures."
FREQUENCIES: Final = "Frequencies, e.g. '1 Hz:150 Hz:20', or a list."
INPUTS: Final = "What drives the model, e.g. 'p_set=Demand [bar]'."
LOOP: Final = "Loop, see 'bywire list'."
MAP: Final = "What the columns mean (TOML)."
PARAMETERS: Final = "Parameter set, e.g. roberts2003."
TEST_BENCH: Final = "Bench file (TOML), or an experiment's name."

# Benches and sources.
COMPARE_RUNS: Final = "Result folders of run --out, bench files, or experiments."
COMPARE_FULL: Final = "Show settings and key figures that are the same, too."
RUN_FAULT: Final = "What fails, see 'bywire list faults'."
RUN_OVER: Final = "Run for each value, e.g. motor.R_m=0.2ohm:0.6ohm:9."
SOURCE: Final = "Published source, e.g. dardanelli2010."

# Many cases.
CAMPAIGN: Final = "Campaign file (TOML), or a campaign's name, e.g. motorcycle."
LIFE: Final = "Life file (TOML), or the name of a life."
LIFE_CHECK: Final = "Stops to run one by one as well, to check the projection."
STUDY_CASES: Final = (
    "Cases in place of the file's; more extend the study, fewer take back what is not computed."
)
STUDY_FILE: Final = "Study file (TOML)."

# Loops and sizes.
AGREEMENT_AMPLITUDES: Final = "A small and a large amplitude, e.g. '0.001 rad, 1 rad'."
AMPLITUDES: Final = "Amplitudes, e.g. '0.5 rad, 1 rad'."
BANDWIDTH_OVER: Final = "Range, for bandwidths, e.g. motor.R_m=0.2ohm:0.6ohm:5."
DESIGN_AMPLITUDES: Final = "Amplitudes of the sines on the bench, e.g. '1 bar, 3 bar'."
DESIGN_OVER: Final = "Range to serve too, e.g. motor.R_m=0.2ohm:0.6ohm:5 or at=5bar:35bar:7."
DESIGN_REQUIRE: Final = "Requirement, e.g. 'bandwidth >= 10 Hz'; as often as needed."
DESIGN_SCHEDULE: Final = "Gains by region; --at then lists points of all regions."
DESIGN_LINEAR: Final = "Leave out the nonlinear bench."
DITHER: Final = "Also about its motion under dither, friction on."
EXCITATION: Final = "sine (one frequency at a time), multisine, or chirp."
FRICTION: Final = "Of a plant: removed (as of loops), sliding, or stuck."
LOCUS: Final = "Poles over a range, e.g. motor.R_m=0.1ohm:1ohm:71."
LOOP_OR_PLANT: Final = "Loop or plant, see 'bywire list'."
MARGINS_OVER: Final = "Range, e.g. motor.R_m=0.2ohm:0.6ohm:9 or at=5bar:35bar:7."
REDUCE: Final = "Reduce it to an order, e.g. 4, or to a band, e.g. '150 Hz'."
SIZING: Final = "Sizing study, see 'bywire list'."
SIZING_CHANGES: Final = "Change an option or a parameter, e.g. t_90=120ms."
SPEED: Final = "Motor speed of sliding, e.g. '5 rad/s'."

# Measurements.
HOLDOUT: Final = "Measurement that is not fitted: validation."
LOSS: Final = "linear, soft_l1, huber or cauchy."
MEASUREMENT: Final = "Measurement file."
MEASUREMENTS: Final = "Measurement files."
METHOD: Final = "Method, see 'bywire list'."
METHOD_OPTION: Final = "Its options: 'bywire list METHOD'."
NOISY_OUTPUT: Final = "Measured output, its column or noise: 'p_mc=Pressure [psi] +- 0.02 bar'."
PRIOR: Final = "What is known of it, e.g. 'motor.R_m=0.35 +- 0.02 ohm'."
REPLAY_OUTPUT: Final = "What is compared, e.g. 'p_mc=Pressure [psi]'; by default all."
SEED: Final = "Seed of the starts, or the study's first."
START: Final = "State whose initial value is unknown, e.g. omega."
STARTS: Final = "Starts of the search: 16; with --study 1."
SYNTHETIC: Final = "Identify a simulated measurement instead."
TIME: Final = "Column of the instants, e.g. 'Zeit [s]', or a rate, '1 kHz'."
TOLERANCE: Final = "Tolerance, e.g. 'nrmse <= 5 %', 'p_mc.max_error <= 2 bar'."
TRACK: Final = "Track a drifting parameter as well, e.g. mu_B."
UNKNOWN: Final = "What is searched, e.g. 'motor.R_m=0.1..1 ohm', offset.i_meas."
