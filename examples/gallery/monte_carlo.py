"""Monte Carlo: 256 motorcycles with different seals
=================================================

Five friction parameters of the seals vary independently by 25 % (log-normal, one standard
deviation), while the ECU assumes the nominal values. All cases run in parallel, in the lanes of the
vector unit and on all cores.

With dither, nine in ten brakes hold the pressure within a quarter of a bar. Without dither, each
brake sticks wherever its friction allows. The band is several times wider, and stays wide.
"""

import time
from argparse import ArgumentParser
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import bywire
from bywire.authoring import as_run

parser = ArgumentParser(description="Show how much the pressure varies with seal friction.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

BAR, CASES = 1e5, 256
VARIED = ("seal.T_pr", "seal.f_cfr_p", "seal.f_cfr_n", "seal.k_brk_p", "seal.k_brk_n")
nominal = bywire.parameters("dardanelli2010").leaves()
draw = np.random.default_rng(2010).standard_normal
variations = {name: nominal[name] * np.exp(0.25 * draw(CASES)) for name in VARIED}
for name in ("seal.k_brk_p", "seal.k_brk_n"):  # breakaway is never less than Coulomb friction
    variations[name] = np.maximum(variations[name], 1.0)

bands = {}
for label, gain in (("without dither", 0.0), ("with dither", 1.0)):
    overrides = {"ecu.dither.gain": gain}
    bench = bywire.Bench("hard-braking", "dardanelli2010", overrides=overrides)
    case = bench.cases()[0]
    started = time.perf_counter()
    ensemble = bywire.simulate_ensemble(as_run(case, bench.step), variations, ["p_mc"])
    elapsed = time.perf_counter() - started
    # Average over one dither period, because the ripple is not the subject here.
    p = np.apply_along_axis(np.convolve, 1, ensemble["p_mc"] / BAR, np.ones(20) / 20, "valid")
    t = ensemble.time[10:-9] - case.settle
    bands[label] = np.percentile(p, [5, 50, 95], axis=0)
    low, middle, high = bands[label][:, -1]
    print(f"{label:15s} {low:6.2f} .. {middle:6.2f} .. {high:6.2f} bar at the end, {elapsed:.1f} s")

width = {label: band[2] - band[0] for label, band in bands.items()}
if out:
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for label, (low, middle, high) in bands.items():
        axes.fill_between(t, low, high, alpha=0.4, label=f"{label}, 5 to 95 %")
        axes.plot(t, middle, linewidth=0.8, color="black")
    axes.set(xlabel="time [s]", ylabel="pressure [bar]", xlim=(0.0, 1.2), ylim=(34.0, 40.0))
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "monte_carlo.png", dpi=150)

late = t > 1.0
assert np.all(width["with dither"][late] < 0.25)
assert np.all(width["without dither"][late] > 4.0 * width["with dither"][late])
