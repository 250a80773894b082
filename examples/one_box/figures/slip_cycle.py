"""Figure of the anti-lock cycle: brake torque versus slip, with the torque that the road holds."""

from __future__ import annotations

import numpy as np

from bywire.authoring import FigureKind, Result, ShownFigure, style
from bywire.plant import adhesion, road
from one_box.rigs.corner import OneBoxCornerParameters

_FAST = 0.3  # fraction of the initial speed above which the cycle is drawn


def _draw(result: Result) -> list[ShownFigure]:
    run = result.recordings["run"]
    par = OneBoxCornerParameters.model_validate_json(run.attrs["parameters"])
    v = run["v_x"].values
    shown = (v > _FAST * v[0]) & (run["time"].values >= 0.0)
    figure, axes = style.new_figure(3.4, (1.0,))
    slip = np.linspace(0.0, max(float(run["slip"].values[shown].max()), 0.1), 400)
    ground, tire = road.surface(0.0, par.corner.road), par.corner.tyre
    held = [float(adhesion.adhesion(each, ground, tire)) for each in slip.tolist()]
    load = par.corner.body.m * par.corner.body.g * par.wheel.r
    axes[0].plot(slip, load * np.array(held), color=style.BLUE, label="road at constant slip")
    torque = run["T_brake"].values[shown]
    axes[0].plot(run["slip"].values[shown], torque, color=style.VERMILLION, label="brake")
    axes[0].set_xlabel(style.axis_label("slip", "1"))
    axes[0].set_ylabel(style.axis_label("torque at the wheel", "N*m"))
    style.legend_above(axes[0])
    caption = (
        "Brake torque versus slip. The wheel accelerates while the torque is below the road's."
    )
    return [ShownFigure("slip-cycle", figure, caption)]


FIGURE = FigureKind("slip-cycle", _draw)
