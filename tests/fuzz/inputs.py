"""Generated bench files, command lines, measurement files and parameter sets, each of a seed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import xarray as xr

from bywire.core.catalog import parameters
from bywire.core.parameters import leaf_fields
from bywire.data.writing import write_measurement
from fuzz import commands, sound

ENDINGS = (".csv", ".tsv", ".nc", ".mat", ".h5", ".parquet", ".mf4")
_NUMBERS = (
    "0",
    "-1",
    "1",
    "1e-300",
    "1e300",
    "5e-324",
    "1.7e308",
    "1e400",
    "nan",
    "inf",
    "-inf",
    "365.9670339332694",
    "1.3e19",
    "0.1234567891234567",
    "1e-9",
    "9007199254740993",
    "3.2e-19",
    "1" + 400 * "0",
    "true",
    "[]",
    "{}",
    "[1, 2]",
    "1979-05-27",
    '""',
    '"\\u0000"',
    "0x10",
    "1_000",
)
_UNITS = (
    "",
    " s",
    " mm",
    " bar",
    " Pa",
    " ohm",
    " V",
    " A",
    " %",
    " N*m",
    " kg",
    " rad/s",
    " Hz",
    " furlong",
    " m^3/(s*Pa)",
    " °C",
    " ns",
    " 1/0",
    " s s",
    " s**1e9",
)
_NAMES = (
    "x" * 400,
    "",
    " ",
    "a.b.c",
    "motor.R_m ",
    "motor.r_m",
    "../../x",
    "\u202e",
    "\x1b[31m",
    "options.duration",
    "simulation.step",
    "simulation.error",
    "simulation.record",
    "simulation.seed",
    "requirements.overshoot",
    "stimulus.kind",
    "parameters",
    "experiment",
)
DEFECTS = 0.25
"""share of benches and commands with a defect"""


@cache
def leaves(name: str) -> dict[str, tuple[float, str]]:
    """Return the numbers of a parameter set with their units."""
    par = parameters(name)
    units = leaf_fields(type(par))
    return {
        key: (number, units[key].unit.symbol)
        for key, number in par.leaves().items()
        if key in units
    }


def number(rng: Random) -> str:
    """Return a number, or what stands in its place."""
    if rng.random() < 0.2:
        return rng.choice(_NUMBERS).replace('"', "")
    return f"{rng.choice((-1, 1, 1, 1)) * 10 ** rng.uniform(-20, 20):.{rng.randrange(1, 17)}g}"


def value(rng: Random) -> str:
    """Return something that may stand for a quantity."""
    return number(rng) + rng.choice(_UNITS)


def extreme(rng: Random, name: str) -> list[str]:
    """Return words of a command that scale parameters by many powers of ten."""
    texts = []
    for key in rng.sample(sorted(leaves(name)), rng.randrange(1, 4)):
        size, unit = leaves(name)[key]
        scaled = size * 10 ** rng.uniform(-12, 12)
        texts += ["--set", f"{key}={scaled:.6g} {'' if unit == '1' else unit}"]
    return texts


def with_defect(rng: Random, entries: sound.Entries) -> sound.Entries:
    """Return entries of a bench of which a key or a value is wrong, or nearly so."""
    key = rng.choice(list(entries))
    kept = {name: text for name, text in entries.items() if name != key}
    text, unit = entries[key], rng.choice(_UNITS)
    quantity = text.partition(" ")[0]
    return kept | rng.choice(
        (
            {key: value(rng)},
            {key: number(rng) + text.removeprefix(quantity)},
            {key: quantity + unit},
            {key: f"-{text}"},
            {key: text[: rng.randrange(len(text))]},
            {key: f"{text}, {text}"},
            {rng.choice(_NAMES): text},
            {
                key[: rng.randrange(len(key))]
                + rng.choice("xR.")
                + key[rng.randrange(len(key)) :]: text
            },
            {key: text, f"simulation.{rng.choice(('step', 'record', 'seed', 'stpe'))}": value(rng)},
        )
    )


def bench_text(rng: Random) -> tuple[str, bool]:
    """Return a bench file, and whether it is one without a defect."""
    experiment, name, entries = sound.bench(rng)
    if rng.random() > DEFECTS:
        return sound.as_toml(rng, experiment, name, entries), True
    if rng.random() < 0.7:
        return sound.as_toml(rng, experiment, name, with_defect(rng, entries)), False
    text = sound.as_toml(rng, experiment, name, entries)
    place = rng.randrange(len(text))  # what an editor or a disk may do to it
    damage = rng.choice(("", '"', "]", "\n", "\x00", "=", "é", "[set]\n"))
    return text[:place] + damage + text[place + 1 :], False


def command_line(rng: Random, folder: Path) -> tuple[list[str], bool]:
    """Return a command, and whether its arguments are right; a file that it reads is written."""
    words = commands.command(rng, folder)
    if rng.random() > DEFECTS:
        return words, True
    k = rng.randrange(len(words))
    other = rng.choice(
        (
            rng.choice(_NAMES),
            value(rng),
            "--",
            "--out",
            "--json",
            "-x",
            "",
            words[k] + "x",
            words[k][: len(words[k]) // 2],
            rng.choice(words),
        )
    )
    kind = rng.randrange(4)
    words = (
        [*words[:k], other, *words[k + 1 :]]
        if kind < 2
        else [*words[:k], other, *words[k:]]
        if kind == 2
        else [*words[:k], *words[k + 1 :]]
    )
    return [word.replace("\x00", "") for word in words], False


@cache
def sound_file(ending: str, folder: Path) -> bytes:
    """Return a small measurement in a format."""
    time = np.arange(60) * 1e-3
    data = xr.Dataset(
        {
            "p_mc": ("time", 1e5 + 1e3 * np.sin(time * 50.0), {"units": "Pa", "long_name": "p"}),
            "x_mc": ("time", 1e-3 * time, {"units": "m"}),
        },
        coords={"time": ("time", time, {"units": "s"})},
    )
    path = folder / f"sound{ending}"
    formats = {".h5": "mat73"}
    if ending == ".h5":
        _text_attributes(path, data)
    else:
        write_measurement(data, path, format=formats.get(ending, ""), overwrite=True)
    content = path.read_bytes()
    path.unlink()
    return content


def _text_attributes(path: Path, data: xr.Dataset) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, variable in data.variables.items():
            made = file.create_dataset(str(name), data=variable.values)
            for key, text in variable.attrs.items():
                made.attrs[key] = text


def damaged(rng: Random, content: bytes) -> bytes:
    """Return a file that was cut, flipped, or repeated somewhere."""
    kind = rng.randrange(5)
    if kind == 0:
        return content[: rng.randrange(len(content) + 1)]
    broken = bytearray(content)
    if kind == 1 and (heap := content.find(b"GCOL")) >= 0:
        broken[heap + rng.randrange(8, 80)] = rng.choice((0, 1, 127, 128, 255))
        return bytes(broken)
    if kind == 4:
        begin = rng.randrange(len(content))
        return content[:begin] + content[begin : begin + rng.randrange(1, 200)] + content[begin:]
    reach = len(content) if kind == 2 else min(1024, len(content))
    for _ in range(rng.randrange(1, 6)):
        broken[rng.randrange(reach)] = rng.randrange(256)
    return bytes(broken)


def table(rng: Random) -> bytes:
    """Return a text table of odd cells."""
    separator = rng.choice((",", ";", "\t", " "))
    cells = (
        "1",
        "2.5",
        "1,5",
        "",
        "nan",
        "inf",
        '"1"',
        '"1',
        "1e999",
        "x",
        "1979-05-27",
        "\u0661",
        "0" * 300,
        "-",
        "1 2",
    )
    head = separator.join(rng.sample(("time [s]", "pedal [mm]", "p [bar]", "x", "", "t [ms]"), 3))
    rows = [
        separator.join(
            f"{k * 0.01:.2f}"
            if c == 0 and rng.random() < 0.97
            else rng.choice(cells)
            if rng.random() < 0.02
            else f"{rng.random():.3f}"
            for c in range(3 if rng.random() < 0.99 else 4)
        )
        for k in range(rng.randrange(60))
    ]
    end = rng.choice(("\n", "\r\n", ""))
    return ("\n".join([head, *rows]) + end).encode(
        rng.choice(("utf-8", "utf-16", "latin-1")), "replace"
    )


def numbered(seed: int, kind: str) -> Iterator[tuple[int, Random]]:
    """Yield a generator of random numbers for each case, which its number tells."""
    for k in itertools.count():
        yield k, Random(f"{seed}-{kind}-{k}")
