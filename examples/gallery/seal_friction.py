"""Friction of a sealed piston: growth with pressure, and the error of the loop height
===================================================================================

The pressure behind a seal also presses on the seal, so its friction is F_0 + f p, as in eq. (16) of
Dardanelli, Alli, Savaresi (2010). The usual estimate is half the height of the loop of force versus
travel. If a regulator lets the pressure differ between the two directions, part of that height is
pressure times area. Here the pressure differs by 0.06 bar, which adds 1.5 N.

Use --data for measured records (x [mm], p [bar], F [N] versus t, any file that `bywire convert`
writes).
"""

from argparse import ArgumentParser
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bywire.authoring import METHODS, Effort, measured

parser = ArgumentParser(description="Identify the friction of a sealed piston.")
parser.add_argument("--data", type=Path, nargs="+", help="records, one per pressure")
parser.add_argument("--map", type=Path, help="mapping file for the columns")
parser.add_argument("--out", type=Path, help="folder for the figure")
arguments = parser.parse_args()

method = METHODS.find("seal-friction")
options = method.defaults
if arguments.data:
    data = measured(arguments.data, arguments.map, method.signals, gaps=True).data
else:
    data = method.synthetic(None, options, 1)
result = method.identify(data, None, options, Effort())
friction = result.estimates["seal friction"]
print(friction)
loop_0, loop_f, between = (
    result.figures[name][0]
    for name in (
        "loop_half_width_at_0",
        "loop_half_width_over_pressure",
        "pressure_between_directions",
    )
)
print(f"loop: {loop_0:.2f} N + {1e5 * loop_f:.2f} N/bar; pressure differs {between / 1e5:.3f} bar")

line = result.curves[0].data
if arguments.out:
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    bar = line["p"] / 1e5
    axes.fill_between(bar, line["low"], line["high"], alpha=0.3, label="95 % band")
    axes.plot(bar, line["value"], label="friction")
    axes.plot(bar, line["measured"], "ko", markersize=4, label="records, each direction")
    axes.plot(bar, loop_0 + loop_f * line["p"], "--", label="half the loop")
    axes.set(xlabel="pressure [bar]", ylabel="friction [N]", ylim=(0, None))
    axes.legend()
    arguments.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.out / "seal_friction.png", dpi=150)

# The error of the loop is half the pressure difference times the area.
level = np.array([3e5, 6e5])
excess = loop_0 + loop_f * level - friction["F_0"] - friction["f"] * level
assert np.all(np.abs(excess - 0.5 * between * friction["A"]) < 0.25 * np.abs(excess))
