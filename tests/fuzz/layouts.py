"""Measurement files of every format in random layouts, units and defects, against what is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.io import savemat

from bywire.core.errors import InputError
from bywire.data.measurement import read_with_notes
from bywire.data.writing import write_measurement
from fuzz.judge import Verdict

_SAMPLES = 40
# Units as programs write them, with the factor to SI and what zero is there, by hand.
_UNITS = (
    ("bar", 1e5, 0.0),
    ("mbar", 1e2, 0.0),
    ("MPa", 1e6, 0.0),
    ("bar(g)", 1e5, 0.0),
    ("psi", 0.45359237 * 9.80665 / 0.0254**2, 0.0),
    ("mm", 1e-3, 0.0),
    ("mm/s", 1e-3, 0.0),
    ("km/h", 1 / 3.6, 0.0),
    ("Nm", 1.0, 0.0),
    ("Nm/A", 1.0, 0.0),
    ("mV/Nm", 1e-3, 0.0),
    ("U/min", np.pi / 30, 0.0),
    ("rpm", np.pi / 30, 0.0),
    ("Grad", np.pi / 180, 0.0),
    ("deg/s", np.pi / 180, 0.0),
    ("degC", 1.0, 273.15),
    ("degF", 5 / 9, 459.67 * 5 / 9),
    ("K/s", 1.0, 0.0),
    ("m/s2", 1.0, 0.0),
    ("m/s^2", 1.0, 0.0),
    ("kN/mm", 1e6, 0.0),
    ("Ohm", 1.0, 0.0),
    ("mA", 1e-3, 0.0),
    ("%", 1e-2, 0.0),
    ("l/min", 1e-3 / 60, 0.0),
    ("1/min", 1 / 60, 0.0),
    ("cm3/s", 1e-6, 0.0),
    ("kWh", 3.6e6, 0.0),
    ("ft-lb", 0.3048 * 0.45359237 * 9.80665, 0.0),
    ("PS", 735.49875, 0.0),
    ("W/(m2*K)", 1.0, 0.0),
)
_WRONG = ("ma", "k N", "dB", "tex", "furlong", "J/kg*K", "C", "g", "grad", "m*", "N/m)", "bra")
_MARKS = ("NA", "nan", "-", "OVLD", "#N/A", "Inf", "9.9E37", "", "∞", "null", "off")
_SEPARATORS = (",", ";", "\t", " ")


@dataclass
class Known:
    """A measurement, and what its file is to give.

    Parameters
    ----------
    time
        Instants [s].
    signals
        Numbers by name, as the file has them; NaN where it has a mark.
    units
        Unit of each with factor and zero.
    """

    time: NDArray[np.float64]
    signals: dict[str, NDArray[np.float64]]
    units: dict[str, tuple[str, float, float]]

    def mapping(self, **more: Any) -> dict[str, Any]:
        """Return the mapping that says the units."""
        return {"signals": {n: {"unit": unit[0]} for n, unit in self.units.items()}, **more}


def known(rng: Random) -> Known:
    """Return a random measurement of up to four signals."""
    names = rng.sample(("p_mc", "Weg", "F 1", "T_oil", "i"), rng.randrange(1, 5))
    time = np.round(np.cumsum([rng.uniform(0.5, 1.5) for _ in range(_SAMPLES)]) * 0.01, 3)
    time = np.unique(time)
    signals = {}
    for name in names:
        signals[name] = np.round([rng.uniform(-9, 9) for _ in time], rng.randrange(1, 6))
        for k in range(len(time)):
            if rng.random() < 0.02:
                signals[name][k] = np.nan
    return Known(time, signals, {name: rng.choice(_UNITS) for name in names})


def case(rng: Random, folder: Path) -> Verdict:
    """Read a generated file and compare every number with what was written."""
    data = known(rng)
    ending, write = rng.choice(_WRITERS)
    path = folder / f"case{ending}"
    mapping = write(rng, data, path)
    if rng.random() < 0.15:
        return _with_a_wrong_unit(rng, data, path, mapping)
    try:
        found, notes = read_with_notes(path, mapping)
    except InputError as error:
        return Verdict(2, f"refused: {error}; {mapping}", True)
    except Exception as error:
        return Verdict(3, f"traceback: {error!r}; {mapping}")
    return Verdict(0, _difference(data, found, notes), True)


def _with_a_wrong_unit(
    rng: Random, data: Known, path: Path, mapping: dict[str, Any] | None
) -> Verdict:
    """Return whether a unit that is none is refused, in the mapping."""
    name, unit = rng.choice(list(data.signals)), rng.choice(_WRONG)
    try:
        read_with_notes(path, {**(mapping or {}), "signals": {name: {"unit": unit, "scale": 1.0}}})
    except InputError as error:
        return Verdict(2, "" if "unit" in str(error) else f"{unit!r}: {error}")
    return Verdict(0, f"the unit {unit!r} was read")


def _difference(data: Known, found: xr.Dataset, notes: tuple[str, ...]) -> str:
    for name, numbers in data.signals.items():
        if name not in found:
            return f"{name} is not there, only {list(found)}"
        _, factor, zero = data.units[name]
        signal = found[name]
        wanted = numbers * factor + zero
        if signal.shape != wanted.shape:
            return f"{name}: {signal.size} of {wanted.size} samples"
        if not np.allclose(signal, wanted, rtol=1e-9, atol=1e-12 * factor, equal_nan=True):
            return f"{name} [{data.units[name][0]}]: {signal.values[:5]}, not {wanted[:5]}"
        time = signal[signal.dims[0]].values
        if not np.allclose(time - time[0], data.time - data.time[0], atol=2e-9):
            return f"{name}: its instants are {time[:5]}, not {data.time[:5]}"
    return ""


def _text(rng: Random, data: Known, path: Path) -> dict[str, Any] | None:
    separator = rng.choice(_SEPARATORS)
    decimal = "," if separator != "," and rng.random() < 0.4 else "."
    marks = [
        m
        for m in _MARKS
        if m not in ("9.9E37" if decimal == "," else "", "" if separator == " " else "x")
    ]
    mapping: dict[str, Any] = {"missing": ["off"]}
    instants, title = _instants(rng, data, decimal, separator)
    names = [n.replace(" ", "_") if separator == " " else n for n in data.signals]
    data.signals = dict(zip(names, data.signals.values(), strict=True))
    data.units = dict(zip(names, data.units.values(), strict=True))
    units = [data.units[n][0] for n in names]
    style = rng.randrange(3)
    if style == 0:
        header = [[title, *(f"{n} [{u}]" for n, u in zip(names, units, strict=True))]]
    elif style == 1:
        bare, _, unit = title.partition(" [")
        header = [[bare, *names], [unit.rstrip("]") or "s", *units]]
    else:
        header = [[title, *names]]
        mapping |= data.mapping()
    rows = [
        [t, *(_cell(rng, v[k], decimal, marks) for v in data.signals.values())]
        for k, t in enumerate(instants)
    ]
    lines = [separator.join(row) for row in (*header, *rows)]
    if rng.random() < 0.3 and separator != " ":
        lines[len(header) + 5 : len(header) + 5] = ["# a remark"]
    before = rng.choice(
        ([], [], ["# rig 3", "# by night"], ["Rig 3", "", "by night"], [f"sep={separator}"])
    )
    if before[:1] == [f"sep={separator}"] and separator == " ":
        before = []
    ends = rng.choice(("\n", "\r\n"))
    text = ends.join([*before, *lines]) + ends
    encoding = rng.choice(("utf-8", "utf-8-sig", "utf-16", "cp1252"))
    if encoding == "cp1252":
        text = text.replace("∞", "Inf")
    path.write_bytes(text.encode(encoding))
    return mapping


def _cell(rng: Random, value: float, decimal: str, marks: list[str]) -> str:
    return rng.choice(marks) if np.isnan(value) else repr(float(value)).replace(".", decimal)


def _instants(rng: Random, data: Known, decimal: str, separator: str) -> tuple[list[str], str]:
    """Return the instants as numbers, times of day or dates, with their title."""
    kind = rng.randrange(4)
    if kind == 0 or (kind == 1 and separator == " "):
        return [f"{1e3 * t:.3f}".replace(".", decimal) for t in data.time], "time [ms]"
    start = datetime(2026, 11, 26, 23, 59, 59, 800_000)
    moments = [start + timedelta(seconds=float(t)) for t in data.time]
    if kind == 1:
        return [m.strftime("%d.%m.%Y %H:%M:%S.%f") for m in moments], "time"
    if kind == 2:
        return [m.strftime("%H:%M:%S.%f") for m in moments], "time"
    return [m.isoformat(timespec="microseconds") for m in moments], "time"


def _lvm(rng: Random, data: Known, path: Path) -> dict[str, Any] | None:
    columns = rng.choice(("One", "Multi"))
    names, units = list(data.signals), [data.units[n][0] for n in data.signals]
    count = len(names)
    head = [
        "LabVIEW Measurement\t",
        "Separator\tTab",
        "Decimal_Separator\t.",
        f"X_Columns\t{columns}",
        "***End_of_Header***\t",
        "\t",
        f"Channels\t{count}",
        "\t".join(["Y_Unit_Label", *units]),
        "\t".join(["X_Dimension", *["Time"] * count]),
        "\t".join(["Delta_X", *["0.01"] * count]),
        "***End_of_Header***",
    ]
    titles = ["X_Value", *names] if columns == "One" else [t for n in names for t in ("X_Value", n)]
    rows = []
    for k, t in enumerate(data.time):
        cells = ["NaN" if np.isnan(v[k]) else repr(float(v[k])) for v in data.signals.values()]
        rows.append(
            [f"{t:.6f}", *cells]
            if columns == "One"
            else [c for v in cells for c in (f"{t:.6f}", v)]
        )
    lines = [*head, "\t".join([*titles, "Comment"]), *("\t".join(row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return None


def _vbo(rng: Random, data: Known, path: Path) -> dict[str, Any] | None:
    names = [name.replace(" ", "_") for name in data.signals]
    data.signals = dict(zip(names, data.signals.values(), strict=True))
    data.units = dict(zip(names, data.units.values(), strict=True))
    seconds = 86399.0 + data.time
    stamps = [
        f"{int(s % 86400) // 3600:02d}{int(s % 86400) % 3600 // 60:02d}{s % 60:06.3f}"
        for s in seconds
    ]
    lines = [
        "File created",
        "",
        "[header]",
        "satellites",
        "time",
        *names,
        "",
        "[channel units]",
        *(data.units[n][0] for n in names),
        "",
        "[column names]",
        " ".join(["sats", "time", *names]),
        "",
        "[data]",
    ]
    lines += [
        " ".join(
            [
                "008",
                stamp,
                *("nan" if np.isnan(v[k]) else f"{v[k]:+.6E}" for v in data.signals.values()),
            ]
        )
        for k, stamp in enumerate(stamps)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return None


def _structs(fields: list[dict[str, Any]]) -> NDArray[Any]:
    array = np.empty((1, len(fields)), dtype=[(name, object) for name in fields[0]])
    for k, each in enumerate(fields):
        array[0, k] = tuple(each.values())
    return array


def _mat(rng: Random, data: Known, path: Path) -> dict[str, Any] | None:
    kind = rng.randrange(4)
    names = list(data.signals)
    mapping = data.mapping()
    if kind == 0:
        content: Any = {
            "log": {
                "time": data.time[:, None],
                "signals": _structs(
                    [
                        {"values": v[:, None], "label": f"{n} [{data.units[n][0]}]"}
                        for n, v in data.signals.items()
                    ]
                ),
            }
        }
        mapping = {} if rng.random() < 0.5 else mapping
    elif kind == 1:
        content = {
            "rec": {
                "X": _structs([{"Name": "time", "Data": data.time[None, :], "Unit": "s"}]),
                "Y": _structs(
                    [
                        {
                            "Name": f"Model/{n}",
                            "Data": v[None, :],
                            "Unit": data.units[n][0],
                            "XIndex": 1,
                        }
                        for n, v in data.signals.items()
                    ]
                ),
            }
        }
        mapping = {}
    elif kind == 2:
        data.time = np.linspace(0.0, 1.0, 100)
        data.signals = {n: np.resize(v, 100) for n, v in data.signals.items()}
        content = {"ans": np.stack([data.time, *data.signals.values()])}
        for k, name in enumerate(names, 2):
            mapping["signals"][name]["column"] = f"ans({k},:)"
    else:
        content = {
            "s": {"Time": data.time, **{f"d{k}": v for k, v in enumerate(data.signals.values())}}
        }
        mapping["time"] = {"column": "s.Time", "unit": "s"}
        for k, name in enumerate(names):
            mapping["signals"][name]["column"] = f"s.d{k}"
    savemat(path, content, do_compression=rng.random() < 0.5)
    return mapping


def _mdf(rng: Random, data: Known, path: Path) -> dict[str, Any] | None:
    import asammdf

    convert = asammdf.blocks.conversion_utils.from_dict
    signals = []
    for name, numbers in data.signals.items():
        raw = np.where(np.isnan(numbers), 65535, np.round(np.abs(numbers) * 1e3)).astype(np.uint16)
        data.signals[name] = np.where(np.isnan(numbers), np.nan, raw * 1e-3 - 4.0)
        codes = rng.choice(
            (
                {"val_0": 65535, "text_0": "SNA"},
                {"lower_0": 65000, "upper_0": 65535, "text_0": "bad"},
            )
        )
        conversion = convert({**codes, "default_addr": {"a": 1e-3, "b": -4.0}})
        signals.append(
            asammdf.Signal(
                raw, data.time, name=name, unit=data.units[name][0], conversion=conversion
            )
        )
    with asammdf.MDF(version=rng.choice(("4.10", "4.00", "4.20"))) as file:
        file.append(signals)
        file.save(path, compression=rng.randrange(3), overwrite=True)
    return None


def _own(rng: Random, data: Known, path: Path) -> dict[str, Any] | None:
    names = [name.replace(" ", "_") for name in data.signals]
    data.signals = dict(zip(names, data.signals.values(), strict=True))
    data.units = dict.fromkeys(names, ("Pa", 1.0, 0.0))
    dataset = xr.Dataset(
        {n: ("time", v, {"units": "Pa"}) for n, v in data.signals.items()},
        coords={"time": ("time", data.time, {"units": "s"})},
    )
    write_measurement(dataset, path, format="mat73" if path.suffix == ".h5" else "", overwrite=True)
    return None


_WRITERS: tuple[tuple[str, Callable[[Random, Known, Path], dict[str, Any] | None]], ...] = (
    (".csv", _text),
    (".txt", _text),
    (".tsv", _text),
    (".csv", _text),
    (".lvm", _lvm),
    (".vbo", _vbo),
    (".mat", _mat),
    (".mat", _mat),
    (".mf4", _mdf),
    (".parquet", _own),
    (".nc", _own),
    (".h5", _own),
)
