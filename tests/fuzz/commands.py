"""Generated commands that are right, of every use case that takes no minutes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import xarray as xr

from bywire.data.writing import write_measurement
from fuzz import sound

_LOOPS = {
    "current": "dardanelli2010",
    "pressure": "dardanelli2010",
    "position": "roberts2003",
    "moment": "roberts2003",
    "drive-current": "roberts2003",
    "screw-position": "roberts2003",
    "force-fight": "roberts2003",
    "force-against": "roberts2003",
}
_PLANTS = {"motorcycle-plant": "dardanelli2010", "wedge-plant": "roberts2003"}
_WORDS = (
    "battery",
    "seal",
    "motor.R_m",
    "experiments",
    "dither",
    "wedge-brake",
    "step",
    "sine",
    "overshoot",
    "hard-braking",
    "pressure",
    "identification",
)
_VARIED = {"dardanelli2010": ("motor.R_m", 0.35, "ohm"), "roberts2003": ("wedge.M_W", 0.5, "kg")}


def command(rng: Random, folder: Path) -> list[str]:
    """Return a command; measurements that it reads lie in the folder then."""
    makers = {
        _run: 4,
        _over: 2,
        _compare: 1,
        _margins: 3,
        _linearize: 2,
        _response: 1,
        _convert: 2,
        _replay: 2,
        _identify: 1,
        _list: 1,
    }
    (make,) = rng.choices(list(makers), list(makers.values()))
    maker: Callable[[Random, Path], list[str]] = make
    return maker(rng, folder)


def _bench(rng: Random) -> list[str]:
    while True:
        experiment, name, entries = sound.bench(rng)
        if not any(key.startswith("stimulus.") for key in entries):  # of a file alone
            return [experiment, "--set", f"parameters={name}", *sound.as_sets(entries)]


def _run(rng: Random, _: Path) -> list[str]:
    more = ["--no-error-estimate"] if rng.random() < 0.2 else []
    return ["run", *_bench(rng), *more]


def _over(rng: Random, _: Path) -> list[str]:
    words = _bench(rng)
    name = words[2].removeprefix("parameters=")
    key, middle, unit = _VARIED["roberts2003" if name == "roberts2003" else "dardanelli2010"]
    low, high = middle * rng.uniform(0.6, 0.95), middle * rng.uniform(1.05, 1.5)
    count = rng.randrange(2, 4)
    return ["run", *words, "--over", f"{key}={low:.4g}{unit}:{high:.4g}{unit}:{count}"]


def _compare(rng: Random, _: Path) -> list[str]:
    duration = sound.text(rng, rng.choice((20e-3, 30e-3)), "s")
    other = rng.choice(("current-step", "hard-braking", "pressure-release"))
    return [
        "compare",
        "hard-braking",
        other,
        "--set",
        f"options.duration={duration}",
        "--set",
        "simulation.step=50 us",
    ]


def _sets(rng: Random, name: str) -> list[str]:
    return sound.as_sets(sound.changes(rng, name)) if rng.random() < 0.7 else []


def _margins(rng: Random, _: Path) -> list[str]:
    loop = rng.choice(sorted(_LOOPS))
    words = ["margins", loop, "--parameters", _LOOPS[loop], *_sets(rng, _LOOPS[loop])]
    if loop == "pressure" and rng.random() < 0.5:
        words += ["--at", sound.text(rng, 1e5 * rng.uniform(5.0, 35.0), "Pa")]
    if rng.random() < 0.3:
        key, middle, unit = _VARIED[_LOOPS[loop]]
        words += ["--over", f"{key}={0.8 * middle:.4g}{unit}:{1.2 * middle:.4g}{unit}:3"]
    return words


def _linearize(rng: Random, _: Path) -> list[str]:
    systems = _LOOPS | _PLANTS
    name = rng.choice(sorted(systems))
    words = ["linearize", name, "--parameters", systems[name], *_sets(rng, systems[name])]
    if name in _PLANTS and rng.random() < 0.5:
        words += rng.choice(
            (
                ["--reduce", "4"],
                ["--friction", "stuck"],
                ["--friction", "sliding", "--speed", "5 rad/s"],
            )
        )
    return words


def _response(rng: Random, _: Path) -> list[str]:
    first = rng.uniform(50.0, 150.0)
    return [
        "frequency-response",
        "current",
        "--frequencies",
        f"{first:.4g} Hz, {2 * first:.4g} Hz",
        *_sets(rng, "dardanelli2010"),
    ]


def _measured(rng: Random, folder: Path) -> Path:
    """Write a pressure and a current at 1 kHz, in some units."""
    time = np.arange(rng.randrange(40, 120)) * 1e-3
    swing = np.sin(2 * np.pi * rng.uniform(2.0, 20.0) * time)
    data = xr.Dataset(
        {
            "p_mc": ("time", 1e5 * (10.0 + rng.uniform(0.0, 5.0) * swing), {"units": "Pa"}),
            "i": ("time", rng.uniform(0.0, 3.0) * swing, {"units": "A"}),
        },
        coords={"time": ("time", time, {"units": "s"})},
    )
    path = folder / f"measured{rng.choice(('.csv', '.tsv', '.nc', '.mat', '.parquet'))}"
    write_measurement(data, path, overwrite=True)
    return path


def _convert(rng: Random, folder: Path) -> list[str]:
    target = folder / f"out{rng.choice(('.csv', '.tsv', '.nc', '.mat', '.parquet', '.mf4'))}"
    words = ["convert", str(_measured(rng, folder)), str(target), "--force"]
    if rng.random() < 0.4:
        words += ["--signals", rng.choice(("p_mc", "i", "p_mc, i"))]
    if rng.random() < 0.4:
        words += ["--rate", sound.text(rng, rng.uniform(200.0, 3000.0), "Hz")]
    return words


def _replay(rng: Random, folder: Path) -> list[str]:
    words = [
        "replay",
        str(_measured(rng, folder)),
        "--bench",
        "hard-braking",
        "--input",
        "p_set=p_mc",
        *_sets(rng, "dardanelli2010"),
    ]
    if rng.random() < 0.5:
        words += ["--output", rng.choice(("p_mc", "i"))]
    if rng.random() < 0.3:
        words += ["--tolerance", f"nrmse <= {rng.uniform(1.0, 200.0):.3g} %"]
    return words


def _identify(rng: Random, _: Path) -> list[str]:
    method = rng.choice(("seal-friction", "current-loop", "motor-winding"))
    return ["identify", method, "--synthetic", str(rng.randrange(1000)), "--starts", "1"]


def _list(rng: Random, _: Path) -> list[str]:
    return ["list", rng.choice(_WORDS)]
