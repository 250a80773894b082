"""Fading pads: track the friction of a wedge brake over several brake applications
================================================================================

The pad friction coefficient decreases from one application to the next, as in hot pads. Moment and
normal force determine it, M = mu_B 2 r_B F_N (Roberts et al. 2003). This relation is linear in
mu_B. A Kalman filter models mu_B as a random walk, with a rate from maximum likelihood.
"""

from argparse import ArgumentParser
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import bywire
from bywire.authoring import track

parser = ArgumentParser(description="Track friction that fades from application to application.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

FADING = np.linspace(0.38, 0.30, 9)
random = np.random.default_rng(1)
runs = []
for mu_B in FADING:
    bench = bywire.Bench(
        "moment-pulses",
        "roberts2003",
        overrides={"wedge.mu_B": float(mu_B)},
        options={"t_hold": 0.5, "pulses": 1},
    )
    runs.append(bywire.run(bench).recording[["y_M", "F_N", "Omega"]].drop_vars("time"))
record = xr.concat(runs, "time")
record = record.assign_coords(time=1e-3 * np.arange(record.sizes["time"]))
for name, sensor in {"y_M": 2.0, "F_N": 10.0}.items():  # standard deviations, N m and N
    record[name] = record[name] + sensor * random.standard_normal(record.sizes["time"])

tracked = track("mu_B", record, bench.par)
mu = tracked.data.sel(parameter="wedge.mu_B")
truth = np.repeat(FADING, runs[0].sizes["time"])
length = runs[0].sizes["time"] * 1e-3
within = np.abs(mu["time"].values % length - 0.5 * length) < 0.35 * length
counts = within & (mu["used"].values > 0)
expected = np.interp(mu["time"].values, record["time"].values, truth)
error = (mu["value"].values - expected)[counts]
inside = ((mu["low"] <= expected) & (expected <= mu["high"])).values[counts]
print(f"{counts.sum()} disc revolutions, root-mean-square error {np.sqrt(np.mean(error**2)):.5f}")
print(f"95 % bands that contain the true value: {100 * inside.mean():.0f} %")

if out:
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(record["time"], truth, "k--", linewidth=1.0, label="true value")
    axes.fill_between(mu["time"], mu["low"], mu["high"], alpha=0.3, label="95 % band")
    axes.plot(mu["time"], mu["value"], label="tracked")
    axes.set(xlabel="time [s]", ylabel="friction coefficient [-]", ylim=(0.28, 0.4))
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "tracked_friction.png", dpi=150)

assert counts.sum() > 40
assert np.sqrt(np.mean(error**2)) < 0.001  # the drift per application is ten times larger
assert inside.mean() > 0.85
