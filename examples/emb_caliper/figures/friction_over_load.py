"""Figure of motor torque versus clamp force while the shaft turns, in both directions."""

from __future__ import annotations

import numpy as np

from bywire.authoring import FigureKind, Result, ShownFigure, style

_STEADY = 0.02  # fraction of the speed demand; at larger errors the motor accelerates


def _draw(result: Result) -> list[ShownFigure]:
    run = result.recordings["run"]
    figure, axes = style.new_figure(3.4, (1.0,))
    F, T, omega, demand = (run[name].values for name in ("F_cl", "torque", "omega", "omega_ref"))
    steady = np.abs(omega - demand) < _STEADY * np.abs(demand)
    for label, color, way in (("apply", style.BLUE, 1.0), ("release", style.VERMILLION, -1.0)):
        moving = steady & (np.sign(omega) == way)
        axes[0].plot(1e-3 * F[moving], T[moving], ".", color=color, markersize=2.0, label=label)
    axes[0].set_xlabel(style.axis_label("clamp force", "kN"))
    axes[0].set_ylabel(style.axis_label("motor torque", "N*m"))
    style.legend_above(axes[0])
    caption = "Motor torque versus clamp force. Friction is half the distance between branches."
    return [ShownFigure("friction-over-load", figure, caption)]


FIGURE = FigureKind("friction-over-load", _draw)
