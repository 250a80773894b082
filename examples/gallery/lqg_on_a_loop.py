"""LQG from python-control, on the exact sampled model of a loop
=============================================================

``bywire design`` designs loops from requirements. For other textbook methods (LQR, observers, pole
placement, loop shaping), use python-control. A loop's models are ``control.StateSpace`` systems
that contain all delays, filters and inner loops.

Here a regulator with an integrator and a Kalman predictor replaces the pressure PID of the
motorcycle brake. Its plant is the brake with its current loop, from the current demand to the
pressure. The regulator is faster than the PID in the catalog, and it shows a textbook result: full
state feedback loses its margin when an observer has to estimate the states.
"""

import math
from argparse import ArgumentParser
from pathlib import Path

import control
import numpy as np
from matplotlib.figure import Figure

import bywire
from bywire.authoring import LOOPS, closed_loop

parser = ArgumentParser(description="Design an LQG regulator for the pressure loop.")
parser.add_argument("--out", type=Path, help="folder for the figure")
out = parser.parse_args().out

BAR, AT = 1e5, 20e5
loop, par = LOOPS.find("pressure"), bywire.parameters("dardanelli2010")
point = loop.point(loop.smooth(par), AT)
current = point.par.replace({"drive.mode": "current"})
whole = closed_loop(
    point.model, current, point.state, point.memory, inputs=("i_set",), outputs=("p_mc",)
)
kept = whole.effective()
A, B = whole.A[np.ix_(kept, kept)], whole.B[kept]
scale = np.linalg.norm(B, axis=1) + np.abs(A).max(axis=1) * 1e-6  # scale of each state
A, B, C = A / scale[:, None] * scale, B / scale[:, None], whole.C[:, kept] * scale / BAR
n, T = len(kept), whole.period

# The integral of the error is an additional state. The regulator weights it and the current.
A_i = np.block([[A, np.zeros((n, 1))], [-T * C, np.eye(1)]])
B_i = np.vstack([B, np.zeros((1, 1))])
Q = np.zeros((n + 1, n + 1))
Q[:n, :n], Q[n, n] = C.T @ C, 3e4
K, _, _ = control.dlqr(A_i, B_i, Q, 2.0 * np.eye(1))
L, _, _ = control.dlqe(A, np.eye(n), C, B @ B.T + 1e-9 * np.eye(n), 1e-4 * np.eye(1))

# Observer and integrator in one controller, from (set point, pressure) to the current demand.
k_x, k_i = K[:, :n], K[:, n:]
A_c = np.block([[A - B @ k_x - L @ C, -B @ k_i], [np.zeros((1, n)), np.eye(1)]])
B_c = np.block([[np.zeros((n, 1)), L], [np.full((1, 1), T), np.full((1, 1), -T)]])
regulator = control.ss(A_c, B_c, -K, np.zeros((1, 2)), T)
brake = control.ss(A, B, C, np.zeros((1, 1)), T)
gain = -brake * regulator[0, 1]
back = control.ss([], [], [], [[0.0], [1.0]], T)
closed = control.feedback(brake * regulator, back, sign=1)[0, 0]
states = control.ss(A_i, B_i, K, np.zeros((1, 1)), T)
omega = 2.0 * math.pi * np.geomspace(0.1, 490.0, 2000)
(_, margin, _, _, crossover, _), (_, margin_states, *_) = (
    control.stability_margins(control.frd(L, omega)) for L in (gain, states)
)

pid = loop.closed(par, AT)
t = np.arange(0.0, 0.4, T)
steps = {
    "LQG": control.step_response(closed, t).outputs,
    "PID in the catalog": control.step_response(pid.state_space(), t).outputs,
}
rise = {name: float(t[np.argmax(y >= 0.9)]) for name, y in steps.items()}
print(
    f"phase margin {margin:.0f} degree at {crossover / 2 / math.pi:.1f} Hz, "
    f"{margin_states:.0f} degree with full state feedback"
)
print(", ".join(f"{name}: 90 % after {1e3 * value:.0f} ms" for name, value in rise.items()))

if out:
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, y in steps.items():
        axes.plot(t, y, label=name)
    axes.set(xlabel="time [s]", ylabel="pressure / step height", title="Without friction")
    axes.legend()
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "lqg_on_a_loop.png", dpi=150)

assert np.abs(closed.poles()).max() < 1.0
assert rise["LQG"] < rise["PID in the catalog"]
assert margin_states > 55.0 > 45.0 > margin > 30.0
