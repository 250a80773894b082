"""A bench in Python without a file: find the lowest sufficient battery voltage
============================================================================

The winding is hot (0.5 ohm instead of 0.35) and the battery leads are old (40 mohm). The pressure
must still rise to 35 bar within 0.1 s and overshoot by 15 % at most. A bench is a frozen object.
`replace` returns a changed copy, and `run` runs it and checks its requirements.

Bisection finds the lowest battery voltage that passes, between 6 and 7 V. Down to 10 V the rise
time hardly increases. Below 10 V the duty cycle saturates, the rise slows down, and the overshoot
is the first requirement that fails.
"""

from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

import bywire

parser = ArgumentParser(description="Find the lowest battery voltage at which a brake passes.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

BAR = 1e5
worn = {"motor.R_m": "0.5 ohm", "supply.R_bat": "40 mohm"}
bench = bywire.Bench(
    experiment="hard-braking",
    parameters="dardanelli2010",
    overrides=worn,
    options={"p_to": "35 bar"},
    requirements={"rise_time": "<= 0.1 s", "overshoot": "<= 15 %"},
    name="weak battery",
)


def judged(voltage):
    """Return the result of the bench at a battery voltage, and its rise time."""
    result = bywire.run(replace(bench, overrides=worn | {"supply.V_bat": f"{voltage} V"}))
    rise_time = next(kpi.value for kpi in result.kpis if kpi.name == "rise_time")
    print(f"{voltage:6.2f} V: {result.status}, rise time {1e3 * rise_time:.0f} ms")
    return result, rise_time


tried = {voltage: judged(voltage) for voltage in (12.0, 10.0, 4.0)}
fails, passes = 4.0, 10.0
while passes - fails > 0.05:
    middle = 0.5 * (passes + fails)
    tried[middle] = judged(middle)
    if tried[middle][0].status == "passed":
        passes = middle
    else:
        fails = middle
print(f"the battery voltage may fall to {passes:.2f} V")
for verdict in tried[fails][0].verdicts:
    print(f"  at {fails:.2f} V {verdict.kpi} {verdict.limit}: {'' if verdict.met else 'not '}met")

if out:
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for voltage in (12.0, passes, 4.0):
        recording = tried[voltage][0].recordings["run"]
        axes.plot(recording["time"], recording["p_mc"] / BAR, label=f"{voltage:.2f} V")
    axes.set(xlabel="time [s]", ylabel="pressure [bar]", xlim=(-0.05, 0.6))
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "own_bench_in_python.png", dpi=150)

assert tried[12.0][0].status == "passed"
assert [v.kpi for v in tried[fails][0].verdicts if not v.met] == ["overshoot"]
assert tried[4.0][0].status == "failed"
assert 6.0 < passes < 7.0
assert tried[10.0][1] < 1.1 * tried[12.0][1]
assert tried[passes][1] > 1.3 * tried[12.0][1]
