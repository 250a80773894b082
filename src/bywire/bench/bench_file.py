"""Read and write a `Bench` as a bench file in TOML; nothing in a bench file is executed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path
from typing import Annotated, Any

from bywire.bench.bench import Bench
from bywire.bench.changes import is_relative, settled
from bywire.bench.experiment import EXPERIMENTS, error_text, two_steps
from bywire.bench.faults.fault_section import Course, numbers_as_text
from bywire.bench.faults.injected import checked_sections
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS, experiment_of, usual_set
from bywire.bench.stimulus import STIMULI, stimulus_sections
from bywire.core.arguments import checked
from bywire.core.brake import loaded_files
from bywire.core.callers import is_command_line, option
from bywire.core.catalog import PARAMETER_SETS, sets_of_loaded
from bywire.core.errors import InputError, ParameterError, UnknownNameError, quoted, unknown_name
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.section import Hint, Section, Table, table_of
from bywire.core.values import parsed, require_unit, require_units
from bywire.data.toml_file import BENCH, first_there, near_files, read_toml, require_kind

PATHS = ("trace", "trace_map", "file")
"""keys of options and stimuli that specify files: bench files contain them as absolute paths"""


def bench_text(bench: Bench, comment: str = "") -> str:
    """Return a bench as TOML.

    Parameters
    ----------
    bench
        Bench to write; numbers get their SI units, and texts remain as typed. A step that bywire
        chose for a stated error is written in place of the error.
    comment
        Text of the first lines, as a comment.

    Examples
    --------
    >>> print(bench_text(Bench("hard-braking", "dardanelli2010", overrides={"motor.R_m": 0.4})))
    experiment = "hard-braking"
    parameters = "dardanelli2010"
    <BLANKLINE>
    [set]
    "motor.R_m" = "0.4 ohm"
    <BLANKLINE>
    """
    definition = bench.definition
    simulation: dict[str, Any] = {"step": bench.step} if bench.step != Bench.step else {}
    if bench.error is not None and bench.choice is None:
        simulation = {"error": error_text(float(bench.error))}
    simulation |= {} if bench.record is None else {"record": bench.record}
    simulation |= {"seed": bench.seed} if bench.seed else {}
    simulation |= {} if bench.engine == "auto" else {"engine": bench.engine}
    sections: dict[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {
        "options": (bench.options, _units(definition.options)),
        **_stimulus(bench),
        "set": (bench.overrides, _units(type(bench.par))),
        "simulation": (simulation, {"step": "s", "record": "s"}),
        "requirements": (bench.requirements, {}),
    }
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [f'experiment = "{bench.experiment}"', f'parameters = "{bench.parameters}"']
    lines += [f'assembly = "{bench.assembly}"'] if bench.assembly else []
    for name, (values, units) in sections.items():
        if values:
            lines += ["", f"[{name}]"]
            lines += [f"{_key(k)} = {_text(k, v, units.get(k, '1'))}" for k, v in values.items()]
    for section, fault in zip(bench.faults, bench.injections, strict=True):
        units = _units(Course) | {"value": fault.mode.unit or "1"}
        lines += ["", "[[faults]]"]
        lines += [
            f"{_key(k)} = {_text(k, v, units.get(k, '1'))}"
            for k, v in section.items()
            if k != "set"
        ]
        changed = section.get("set", {})
        of_parameters = _units(type(bench.par))
        lines += [
            f'set."{k}" = {_text(k, v, of_parameters.get(k, "1"))}' for k, v in changed.items()
        ]
    return "\n".join(lines) + "\n"


def _stimulus(bench: Bench) -> dict[str, tuple[Mapping[str, Any], Mapping[str, str]]]:
    """Return the sections of the stimuli by title, each with the units of its values."""
    definition, options = bench.definition, bench.chosen_options
    levels = {} if definition.beside is None else dict(definition.beside(options))
    if definition.driven_unit is not None:
        levels[""] = definition.driven_unit(options)
    stimuli: dict[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {}
    for name, section in stimulus_sections(bench.stimulus).items():
        cls = STIMULI.find(str(section["kind"])).parameter_class
        units = _units(cls, levels[name])
        stimuli[f"stimulus.{name}" if name else "stimulus"] = (section, units)
    return stimuli


def _units(cls: type[ParameterSet], level: str = "") -> dict[str, str]:
    return {n: leaf.unit.symbol.replace("level", level) for n, leaf in leaf_fields(cls).items()}


def _key(name: str) -> str:
    return f'"{name}"' if "." in name else name


def _text(name: str, value: Any, symbol: str) -> str:
    if isinstance(value, (str, Path)):
        path = name in PATHS and str(value)
        return json.dumps(str(Path(path).resolve()) if path else str(value), ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return f"[{', '.join(_text(name, node, symbol) for node in value)}]"
    number = value if isinstance(value, int) else float(value)  # all digits, to reproduce the run
    return json.dumps(f"{number} {symbol}") if symbol != "1" else f"{number}"


# --- Reading

STEP_OR_ERROR = ("step", "error")
"""keys of [simulation] that exclude each other"""


def without_replaced(
    values: Mapping[str, Any], changes: Iterable[str], prefix: str = ""
) -> dict[str, Any]:
    """Return settings without a step or error that changes replace by the other one.

    ``prefix``: prefix of the names of the settings, and of the changes.
    """
    pair = [prefix + key for key in STEP_OR_ERROR]
    stated = [key for key in pair if key in changes]
    return {
        key: value
        for key, value in values.items()
        if key not in pair or not stated or key in stated
    }


_Quoted = Annotated[str, Hint("write it in quotation marks")]


class SimulationSection(Section):
    """Section ``[simulation]``; a `Bench` checks its values."""

    step: Any = Bench.step
    error: Any = None
    record: Any = None
    seed: Any = Bench.seed
    engine: Any = Bench.engine

    @classmethod
    def written_out(cls, content: Any) -> Any:
        """Return the section, with a seed from ``--set`` (a text) as a number."""
        if isinstance(content, Mapping) and content.keys() >= set(STEP_OR_ERROR):
            raise two_steps(*(str(content[key]) for key in STEP_OR_ERROR))
        seed = content.get("seed") if isinstance(content, Mapping) else None
        if isinstance(seed, str) and seed.isdecimal() and len(seed) < 20:
            return {**content, "seed": int(seed)}
        return content


class BenchFile(Section):
    """Keys and sections of a bench file."""

    experiment: _Quoted
    parameters: _Quoted
    assembly: _Quoted = ""
    name: _Quoted = ""
    options: Table
    stimulus: Table
    set: Table
    simulation: SimulationSection = SimulationSection()
    requirements: Table
    faults: Any = ()


_FAULTS, _SIMULATION = "faults", "simulation"
SECTIONS = ("options", "stimulus", "set", "simulation", "requirements")
"""sections of a bench file, without ``[[faults]]``"""
_TOO_LARGE = ". Put measured traces into a separate file (options.trace)"


@checked
def load(path: str | Path) -> Bench:
    """Read a bench file.

    Parameters
    ----------
    path
        TOML file with ``experiment`` and ``parameters``. The sections ``[options]``,
        ``[stimulus]``, ``[set]``, ``[simulation]``, ``[requirements]`` and ``[[faults]]`` are
        optional.

    Returns
    -------
    Bench
        Bench of the file, in SI units; nothing is run.

    Raises
    ------
    FileError
        When the file cannot be read or is not valid TOML.
    InputError
        For any content that is not valid, with the file's name in front.
    """
    return read(path, {})


def read(path: str | Path, changes: Mapping[str, str]) -> Bench:
    """Read a bench file and change it like ``--set key=value``.

    Parameters
    ----------
    path
        Bench file, or the bare name of an experiment for its defaults and the main parameter set of
        its brake.
    changes
        ``options.NAME``, ``stimulus.NAME``, ``simulation.NAME``, ``requirements.NAME``,
        ``experiment``, ``parameters``, or the dotted name of a parameter, which may be a pattern.
        A percentage, ``+50%``, refers to the file's value.
    """
    file = Path(path)
    content = content_of_experiment(file, changes) or read_toml(
        file, "bench file", missing=meant_by, too_large=_TOO_LARGE
    )
    relative = {
        name: value
        for name, value in changes.items()
        if is_relative(name, value) and name.partition(".")[0] not in SECTIONS
    }
    try:
        require_kind(content, BENCH, file)
        plain = {name: value for name, value in changes.items() if name not in relative}
        bench = from_mapping(_changed(content, plain), file.parent, _printable(file.stem))
        return bench.with_overrides(relative) if relative else bench
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None


def from_mapping(content: Mapping[str, Any], folder: Path, name: str) -> Bench:
    """Return the bench for a bench file's content; relative paths start at ``folder``."""
    sets = sets_of_loaded()
    only = {"parameters": sets[0]} if len(sets) == 1 else {}
    content = {"name": name, **only, **content}
    _require_names(content)
    file = BenchFile.read(content, "a bench file")
    options, overrides = flattened(file.options), flattened(file.set)
    _require_units(file, options, overrides)
    stimulus = {
        key: _located(value, folder) if isinstance(value, Mapping) else value
        for key, value in _located(file.stimulus, folder).items()
    }
    return Bench(
        experiment=file.experiment,
        parameters=file.parameters,
        overrides=overrides,
        options=_located(options, folder),
        stimulus=stimulus,
        requirements=file.requirements,
        name=file.name,
        assembly=file.assembly,
        faults=[numbers_as_text(each) for each in checked_sections(file.faults)],
        **file.simulation.given,
    )


def _require_names(content: Mapping[str, Any]) -> None:
    """Reject a bench without an experiment or a parameter set, and list the valid names."""
    if not content.keys() <= BenchFile.model_fields.keys():
        return  # a misspelled key has its own error
    experiment, cited = content.get("experiment"), content.get("parameters")
    if experiment is None:
        known = PARAMETER_SETS.get(str(cited))
        if known is None:
            example, valid = next(iter(EXPERIMENTS.all())), "those of 'bywire list experiments'"
        else:
            each = EXPERIMENTS.all().values()
            names = [experiment.name for experiment in each if experiment.tests(known.assembly)]
            example = names[0]
            valid = ", ".join((*names, *GENERIC_EXPERIMENTS.all()))
        raise _missing("experiment", example, valid)
    if cited is None and isinstance(experiment, str):
        example = usual_set(experiment)
        assembly = PARAMETER_SETS.find(example).assembly
        tested = EXPERIMENTS.get(experiment)
        assemblies = (assembly,) if tested is None else (assembly, *tested.variants)
        sets = PARAMETER_SETS.all().values()
        valid = ", ".join(each.name for each in sets if each.assembly in assemblies)
        raise _missing("parameters", example, valid)


def _missing(key: str, example: str, valid: str) -> ParameterError:
    return ParameterError(
        f'{key} is missing. Add a line such as {key} = "{example}". Valid names are {valid}',
        name=key,
        valid=valid,
    )


def _located(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return values with relative paths resolved against a folder."""
    return {
        key: str(folder / value) if key in PATHS and value and isinstance(value, str) else value
        for key, value in values.items()
    }


def flattened(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested sections as dotted names.

    Raises
    ------
    ParameterError
        For a name that occurs as ``motor.R_m`` and as ``"motor.R_m"``.
    """
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        for each, leaf in (
            flattened(value, f"{name}.") if isinstance(value, Mapping) else {name: value}
        ).items():
            if each in flat:
                raise ParameterError(
                    f'{each} has two values, one for {each} and one for "{each}" in quotation '
                    "marks. Remove one of them",
                    name=each,
                )
            flat[each] = leaf
    return flat


def _printable(name: str) -> str:
    """Return the name of a file without bytes that are not valid text."""
    return name.encode("utf-8", "replace").decode("utf-8")


def _require_units(file: BenchFile, options: Table, overrides: Table) -> None:
    """Reject plain numbers for quantities with a unit: 37 may mean 37 bar or 37 Pa."""
    definition = experiment_of(file.experiment, file.parameters, file.assembly, options)
    require_units(definition.options, options)
    base = PARAMETER_SETS.find(file.parameters).parameters()
    require_units(type(base), settled(base, overrides))
    for key in ("step", "record"):
        require_unit(file.simulation.given.get(key), "s", f"simulation.{key}")
    sections = stimulus_sections(file.stimulus)
    if definition.driven_unit is None and definition.beside is None:
        return
    values = parsed(definition.options, options, f"option of {definition.name}")
    chosen = definition.defaults.replace(values)
    units = {} if definition.beside is None else dict(definition.beside(chosen))
    if definition.driven_unit is not None:
        units[""] = definition.driven_unit(chosen)
    for name, section in sections.items():
        require_unit(section.get("max_gap"), "s", "stimulus.max_gap")
        kind = section.get("kind")
        if isinstance(kind, str) and name in units:
            require_units(STIMULI.find(kind).parameter_class, section, units[name])


def _changed(content: Mapping[str, Any], changes: Mapping[str, str]) -> dict[str, Any]:
    changed = {k: table_of(v, f"[{k}]") if k in SECTIONS else v for k, v in content.items()}
    if _SIMULATION in changed:
        parts = [name.partition(".") for name in changes]
        stated = [key for section, _, key in parts if section == _SIMULATION]
        changed[_SIMULATION] = without_replaced(changed[_SIMULATION], stated)
    for name, value in changes.items():
        section, _, key = name.partition(".")
        near = get_close_matches(section, SECTIONS, n=1, cutoff=0.8)
        if section == "stimulus" and "." in key:
            signal, _, field = key.partition(".")
            known = changed.setdefault(section, {})
            below = known.get(signal, {})
            known[signal] = {**(below if isinstance(below, Mapping) else {}), field: value}
        elif section in ("options", "set") and key:
            changed[section] = {**flattened(changed.get(section, {})), key: value}
        elif section in SECTIONS and key:
            changed.setdefault(section, {})[key] = value
        elif near and key:
            raise unknown_name("section", section, SECTIONS)
        elif name in SECTIONS:
            raise ParameterError(
                f"{name} is a section. Write {name}.NAME=VALUE", name=name, valid=f"{name}.NAME"
            )
        elif section == _FAULTS:
            raise ParameterError(
                f"{option('overrides')} cannot add a fault. Use {option('faults')} "
                "NAME=VALUE@ONSET",
                name=name,
            )
        elif name in BenchFile.model_fields:
            changed[name] = value
        else:
            overrides = flattened(changed.get("set", {}))
            overrides[name] = value
            changed["set"] = overrides
    return changed


# --- A name in place of a file

_NAME = re.compile(r"[a-z][a-z0-9-]*")


_FOLDER = "benches"  # usual folder of bench files
_NEAR, _NEAR_EXPERIMENT = 0.5, 0.7  # minimum similarity of a suggested name


def names_experiment(source: str | Path) -> bool:
    """Return whether a text is the bare name of an experiment."""
    name = str(source)
    if not _NAME.fullmatch(name):
        return False
    return EXPERIMENTS.get(name) is not None or name in GENERIC_EXPERIMENTS.all()


def content_of_experiment(file: Path, changes: Mapping[str, str]) -> dict[str, str]:
    """Return an experiment's shortest bench file; empty if the name belongs to a file.

    Raises
    ------
    ParameterError
        For an experiment for any brake, if ``changes`` do not specify a parameter set.
    UnknownNameError
        For a bare name that is neither an experiment nor a file.
    """
    name = str(file)
    if not file.exists() and _NAME.fullmatch(name) and not names_experiment(name):
        text = f"there is no experiment and no bench file {quoted(name)}: {meant_by(file)}"
        if is_command_line() and not loaded_files():
            stop = "" if text.endswith("?") else "."
            text += f"{stop} Names of your own brake or of an example need --system PATH"
        raise UnknownNameError(text, name="experiment", value=name)
    if file.is_file() or not names_experiment(name):
        return {}
    chosen = {} if "parameters" in changes else {"parameters": usual_set(name)}
    return {"experiment": name, **chosen}


def meant_by(file: Path) -> str:
    """Return advice on a bench file that does not exist.

    The advice is the most similar bench file in the same folder, or the most similar experiment. A
    file of the same name in a folder of benches takes precedence.
    """
    folders = (file.parent / _FOLDER, file.parent / ".." / _FOLDER)
    there = first_there(folder / file.name for folder in folders)
    if there is not None:
        return f"did you mean {there}?"
    near = max(_near(file), default=None)
    if near is not None:
        return f"did you mean {near[1]}?"
    return "check the path, or specify an experiment (see 'bywire list')"


def _near(file: Path) -> Iterator[tuple[float, str]]:
    """Yield bench files and experiments with names similar to that of a file, with similarity."""
    kinds = ("", BENCH)
    files = near_files(file, kinds, [file.parent], _NEAR, with_ending=True)
    yield from ((likeness, str(path)) for likeness, path in files)
    written = file.name.replace("_", "-")  # a file name instead of an experiment's name
    if _NAME.fullmatch(written):
        for name in {**EXPERIMENTS.all(), **GENERIC_EXPERIMENTS.all()}:
            likeness = SequenceMatcher(None, name, written).ratio()
            if likeness >= _NEAR_EXPERIMENT:
                yield likeness, name
