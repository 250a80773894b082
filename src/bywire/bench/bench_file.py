"""Bench files: TOML in, Bench out; nothing in them is executed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.bench.bench import Bench
from bywire.core import units
from bywire.core.errors import FileError, InputError, ParameterError, unknown_name

_SECTIONS = ("options", "stimulus", "set", "simulation", "requirements")
_KEYS = ("experiment", "parameters", "assembly", "name")
_SIMULATION = {"step": "s", "record": "s", "seed": ""}


def load(path: str | Path) -> Bench:
    """Read a bench file.

    Parameters
    ----------
    path
        TOML file with ``experiment`` and ``parameters``, and the sections ``[options]``,
        ``[stimulus]``, ``[set]``, ``[simulation]`` and ``[requirements]`` as wanted.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit, with the file's name in front.
    """
    return read(path, {})


def read(path: str | Path, changes: Mapping[str, str]) -> Bench:
    """Read a bench file and change it as ``--set key=value`` does.

    Parameters
    ----------
    changes
        ``options.NAME``, ``stimulus.NAME``, ``simulation.NAME``, ``requirements.NAME``,
        ``experiment``, ``parameters``, or the dotted name of a parameter.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise FileError(f"cannot read bench file {file}: {reason}") from None
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{file} is not valid TOML: {error}") from None
    try:
        return from_mapping(_changed(content, changes), file.parent, file.stem)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None


def from_mapping(content: Mapping[str, Any], folder: Path, name: str) -> Bench:
    """Return the bench of a bench file's content; relative paths start at ``folder``."""
    for key in content:
        if key not in (*_KEYS, *_SECTIONS):
            raise unknown_name("key", key, (*_KEYS, *_SECTIONS))
    for section in _SECTIONS:
        if not isinstance(content.get(section, {}), Mapping):
            raise ParameterError(f"[{section}] must be a section with key = value lines")
    for key in ("experiment", "parameters"):
        if not isinstance(content.get(key), str):
            raise ParameterError(f"{key} is missing: write {key} = \"...\" (see 'bywire list')")
    options = flattened(content.get("options", {}))
    if options.get("trace"):
        options["trace"] = str(folder / str(options["trace"]))
    bench = Bench(
        experiment=content["experiment"],
        parameters=content["parameters"],
        overrides=flattened(content.get("set", {})),
        options=options,
        stimulus=content.get("stimulus", {}),
        requirements=content.get("requirements", {}),
        name=content.get("name", name),
        **_simulation(content.get("simulation", {})),
    )
    assembly = content.get("assembly", bench.definition.assembly)
    if assembly != bench.definition.assembly:
        raise ParameterError(
            f"assembly = {assembly!r}, but experiment {bench.experiment!r} tests a "
            f"{bench.definition.assembly}"
        )
    return bench


def flattened(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested sections as dotted names."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            flat |= flattened(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def _simulation(section: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in section.items():
        if key not in _SIMULATION:
            raise unknown_name("key in [simulation]", key, _SIMULATION)
        if key == "seed":
            if isinstance(value, str) and value.isdecimal():
                value = int(value)
            if not isinstance(value, int) or isinstance(value, bool) or value < 0:
                raise ParameterError(f"simulation.seed = {value!r}: a whole number >= 0 is wanted")
            found[key] = value
        else:
            found[key] = units.parse(value, "s", f"simulation.{key}")
    return found


def _changed(content: Mapping[str, Any], changes: Mapping[str, str]) -> dict[str, Any]:
    changed = {k: dict(v) if isinstance(v, Mapping) else v for k, v in content.items()}
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if section in _SECTIONS and key:
            changed.setdefault(section, {})[key] = value
        elif name in _KEYS:
            changed[name] = value
        else:
            overrides = flattened(changed.get("set", {}))
            overrides[name] = value
            changed["set"] = overrides
    return changed
