"""Hard braking: one bench file with one change
============================================

The bench demands a pressure step from 6 to 37 bar, as in Fig. 7a of Dardanelli, Alli, Savaresi
(2010). Its ECU shakes the piston with a dither current. At gain 1, the dither just overcomes the
breakaway torque of the seals. This script changes the gain.

Without dither the piston sticks before the pressure reaches its demand. The pressure stays more
than half a bar off, with the piston exactly at rest, although the controller's integral grows.
Dither removes the error, but it costs energy and causes a ripple that increases with the gain. At
every gain the overshoot stays below the 15 % that the paper allows.
"""

from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

import bywire

parser = ArgumentParser(description="Change the dither of a hard-braking bench.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

BAR = 1e5
bench = bywire.load(Path(__file__).parents[2] / "benches" / "hard_braking.toml")
gains = (0.0, 0.75, 1.0, 1.5, 2.0)
results = {g: bywire.run(replace(bench, overrides={"ecu.dither.gain": g})) for g in gains}

# Requirements check key figures. Everything else is in the recording.
overshoot, error, ripple, energy = {}, {}, {}, {}
print("gain  overshoot  mean error  ripple     stuck  energy")
for gain, result in results.items():
    kpis = {kpi.name: kpi.value for kpi in result.kpis}
    pressure = result.recordings["run"]["p_mc"].sel(time=slice(1.0, None))
    ripple[gain] = float(pressure.max() - pressure.min()) / BAR
    overshoot[gain], energy[gain] = kpis["overshoot"], kpis["energy"]
    error[gain] = kpis["steady_state_error"] / BAR
    print(
        f"{gain:4.2f}  {overshoot[gain]:7.1f} %  {error[gain]:+6.3f} bar  {ripple[gain]:5.3f} bar"
        f"  {100 * kpis['share_stuck']:3.0f} %  {energy[gain]:4.1f} J"
    )

if out:
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for gain in (0.0, 1.0, 2.0):
        recording = results[gain].recordings["run"]
        axes.plot(recording["time"], recording["p_mc"] / BAR, label=f"dither gain {gain:g}")
    axes.axhline(37.0 + 0.15 * 31.0, color="black", linestyle=":", label="overshoot of 15 %")
    axes.axhspan(36.9, 37.1, color="black", alpha=0.15, label="steady-state error of 0.1 bar")
    axes.set(xlabel="time [s]", ylabel="pressure [bar]", xlim=(0.0, 1.2), ylim=(30, 43))
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "hard_braking.png", dpi=150)

assert all(value < 15.0 for value in overshoot.values())
assert abs(error[0.0]) > 0.5
assert ripple[0.0] == 0.0  # exactly zero, because the piston is stuck
assert all(abs(error[gain]) < 0.1 for gain in gains[1:])
assert ripple[0.75] < ripple[1.0] < ripple[1.5] < ripple[2.0]
assert energy[0.0] < energy[1.0] < energy[2.0]
