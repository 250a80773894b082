"""Which parameters affect the pressure, and when
==============================================

The kernel computes exact derivatives of a whole run, here of the pressure in hard braking, with
respect to any number of parameters. The script multiplies them by one percent of the parameter, so
they are in bar.

While the pressure rises, caliper, pads, motor constant, gear and piston matter most. Friction
matters little, because dither removes it. At the end, the controller's integral has removed all
effects except one. The ECU subtracts a fixed ambient pressure from the sensor's absolute reading,
so one percent of ambient pressure remains as 0.01 bar in the opposite direction. The four
parameters of the pipeline act through one resistance, so no test of this type can separate them.
"""

from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import bywire
from bywire.authoring import as_run

parser = ArgumentParser(description="Show which parameters affect the pressure.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

BAR, PERCENT = 1e5, 0.01
# The converter is ideal, because a quantized reading has zero derivative and would open the loop.
bench = bywire.Bench("hard-braking", "dardanelli2010", overrides={"adc.law": "ideal"})
case = bench.cases()[0]
run = as_run(case, bench.step)
values = run.par.leaves()
names = [
    name
    for name in values
    if name.split(".")[0] in ("supply", "motor", "gear", "seal", "master_cylinder", "caliper")
] + ["fluid.beta", "fluid.nu", "fluid.rho", "fluid.p_atm", "pipeline.L_pl", "pipeline.k_lf"]

slopes = bywire.simulate_with_sensitivities(run, names, ["p_mc"])
time = slopes.trajectory.time - case.settle
rise, end = (time > 0.0) & (time < 0.2), time > 1.1
moves = {name: slopes.of("p_mc", name) * values[name] * PERCENT / BAR for name in names}
peak = {name: np.max(np.abs(moves[name][rise])) for name in names}
left = {name: np.mean(moves[name][end]) for name in names}
ranked = sorted(names, key=peak.__getitem__, reverse=True)
for name in ranked[:12]:
    print(f"{name:24s} {peak[name]:6.3f} bar during rise, {left[name]:+7.4f} bar at the end")

# For one parameter, compute the same by finite differences from two more runs.
up, down = (
    bywire.simulate(replace(run, par=run.par.replace({"motor.K_e": values["motor.K_e"] * factor})))
    for factor in (1.001, 0.999)
)
difference = (up["p_mc"] - down["p_mc"]) / 0.002 * PERCENT / BAR

if out:
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.barh(ranked[11::-1], [peak[name] for name in ranked[11::-1]], label="maximum during rise")
    axes.plot(
        [abs(left[name]) for name in ranked[11::-1]], ranked[11::-1], "k.", label="at the end"
    )
    axes.set(xlabel="pressure change per 1 % [bar]")
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "sensitivities.png", dpi=150)

assert ranked[0] == "caliper.A_pd"
assert max(peak[name] for name in names if name.startswith("seal.")) < 0.25 * peak[ranked[0]]
assert np.max(np.abs(difference - moves["motor.K_e"])[rise]) < 0.1 * peak["motor.K_e"]
assert all(abs(left[name]) < 0.003 for name in names if name != "fluid.p_atm")
assert abs(left["fluid.p_atm"] + 0.01 * values["fluid.p_atm"] / BAR) < 0.001
same = [moves[name] for name in ("fluid.nu", "fluid.rho", "pipeline.L_pl", "pipeline.k_lf")]
assert np.allclose(same, same[0], atol=1e-9)
