"""Stick-slip: a slow current ramp without and with dither
=======================================================

The current demand rises to 5 A and falls again at 0.2 A/s, as in eq. (17) and Fig. 5 of
Dardanelli, Alli, Savaresi (2010). Without dither the piston sticks most of the time. It breaks
away where the motor torque overcomes load and breakaway torque, eqs. (8), (16) and (18):

    eta_g K_e i = k_g A_mc p + k_brk,p (T_pr + f_cfr,p p)

The piston then slips to a pressure that is at least 50 % higher, so the curve looks like a
staircase. With dither the pressure follows the current in both directions, and the loop loses most
of its area.
"""

from argparse import ArgumentParser
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import bywire

parser = ArgumentParser(description="Show stick-slip on a current ramp, and the effect of dither.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

BAR = 1e5
bench = bywire.Bench("friction-ramp", "dardanelli2010")
result = bywire.run(bench)
kpis = {kpi.name: kpi.value for kpi in result.kpis}
rough, dithered = result.recordings["without-dither"], result.recordings["with-dither"]

# A slip begins at the last sample of sticking, and ends at the pressure where the next one begins.
stuck = rough["stuck"].values > 0
pressure, current = rough["p_mc"].values, rough["i"].values
top = int(np.argmax(pressure))
begins = np.flatnonzero(stuck[:top] & ~stuck[1 : top + 1])
afterward = np.append(pressure[begins[1:]], pressure[top])
chosen = pressure[begins] > 1.0 * BAR  # at low pressure the current resolution matters
begins, before, after = begins[chosen], pressure[begins[chosen]], afterward[chosen]

par = bench.par
breakaway = par.seal.k_brk_p * (par.seal.T_pr + par.seal.f_cfr_p * before)
load = par.gear.k_g * par.master_cylinder.A_mc * before
predicted = (load + breakaway) / (par.gear.eta_g * par.motor.K_e)
print("breaks away at    predicted   pressure before       and after")
for slipped, expected, low, high in zip(current[begins], predicted, before, after, strict=True):
    print(f"{slipped:12.3f} A {expected:10.3f} A {low / BAR:13.2f} bar {high / BAR:11.2f} bar")
print(f"stuck for {100 * kpis['share_stuck_undithered']:.0f} % of the time")
print(f"ratio of the loop areas with and without dither: {kpis['loop_area_ratio']:.2f}")

if out:
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for recording, label in ((rough, "without dither"), (dithered, "with dither")):
        mean = recording[["p_mc", "i_meas"]].rolling(time=20, center=True).mean()  # one period
        axes.plot(mean["p_mc"] / BAR, mean["i_meas"], label=label)
    axes.plot(before / BAR, predicted, "k.", label="predicted breakaway")
    axes.set(xlabel="pressure [bar]", ylabel="measured current [A]")
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "stick_slip_and_dither.png", dpi=150)

assert before.size >= 3
assert np.all(np.abs(current[begins] - predicted) < 0.01)
assert np.all(after > 1.5 * before)
assert kpis["share_stuck_undithered"] > 0.8
assert kpis["loop_area_ratio"] < 0.2
