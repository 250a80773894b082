"""Which method ``bywire identify`` takes, with which parameters and options."""

from __future__ import annotations

import filecmp
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.cli.measured_bench import OnBench, method_on_bench
from bywire.cli.method_options import method_options
from bywire.cli.progress import progress_bar
from bywire.core.errors import ParameterError, unknown_name

if TYPE_CHECKING:
    from bywire.core.parameters import ParameterSet
    from bywire.identification.method import Method


@dataclass(frozen=True)
class Wanted:
    """What is to be identified, and how; texts as on the command line."""

    measurements: Sequence[Path]
    mapping: Path | None
    parameters: str
    changes: Mapping[str, str]
    options: Mapping[str, str]
    starts: int
    seed: int
    synthetic: int | None
    study: int | None
    on_bench: OnBench

    @property
    def files(self) -> list[Path]:
        """All measurement files, the held-out one among them."""
        held = self.on_bench.holdout
        return [*self.measurements, *([] if held is None else [held])]


@dataclass(frozen=True)
class Chosen:
    """The method with its parameters and options; no parameters where it needs none.

    ``changes`` are those of the parameter set, by dotted name, SI.
    """

    method: Method
    name: str
    par: ParameterSet | None
    options: ParameterSet
    changes: Mapping[str, Any]


def choose(name: str, wanted: Wanted) -> Chosen:
    """Return the method of a name with what it needs.

    Raises
    ------
    InputError
        When something that is wanted does not fit.
    """
    method = _method(name, wanted)
    _require_one_source(method, wanted)
    return _chosen(method, wanted)


def _method(name: str, wanted: Wanted) -> Method:
    """Return a method by its name; one for any bench is made for the bench that is given."""
    from bywire.identification.fitting.asked import BENCH_METHODS, find_method

    found = BENCH_METHODS.all().get(name)
    given = wanted.on_bench.given
    if found is None:
        method = find_method(name)
        if given:
            raise ParameterError(
                f"{given[0]} is for methods of any bench ({', '.join(BENCH_METHODS.all())}): leave "
                f"it out for {name}"
            )
        return method
    if not wanted.measurements and wanted.on_bench.holdout is not None:
        raise ParameterError("--holdout is for measurement files: leave it out")
    _require_not_fitted(wanted)
    own = {"parameters": wanted.parameters} if wanted.parameters else {}
    with progress_bar() as progress:
        return method_on_bench(
            found, wanted.on_bench, {**own, **wanted.changes}, wanted.mapping, progress
        )


def _require_not_fitted(wanted: Wanted) -> None:
    """Refuse a held-out file that is fitted too: it proves nothing."""
    held = wanted.on_bench.holdout
    if held is None:
        return
    for path in wanted.measurements:
        try:
            equal = filecmp.cmp(path, held, shallow=False)
        except OSError:  # reading says what is wrong with it
            continue
        if equal:
            same = "is" if path.samefile(held) else "has the same content as"
            raise ParameterError(
                f"--holdout {held} {same} {path}, which is fitted: hold out a record that is not"
            )


def _require_one_source(method: Method, wanted: Wanted) -> None:
    sources = [bool(wanted.measurements), wanted.synthetic is not None, wanted.study is not None]
    if sum(sources) > 1:
        raise ParameterError(
            f"{method.name}: give only one of measurement files, --synthetic SEED, --study COUNT"
        )
    if sum(sources) < 1:
        signals = ", ".join(f"{n} [{unit}]" for n, unit in method.signals.items())
        raise ParameterError(
            f"{method.name} needs one of: measurement files with the signals {signals}, "
            "--synthetic SEED, or --study COUNT"
        )
    if len(wanted.measurements) > 1 and not method.several:
        raise ParameterError(f"{method.name} takes one measurement, not {len(wanted.measurements)}")
    if wanted.mapping is not None and not wanted.measurements:
        raise ParameterError("--map is for measurement files: leave it out")


def _chosen(method: Method, wanted: Wanted) -> Chosen:
    from bywire.api.parameter_choice import set_for
    from bywire.bench.values import parsed

    idle = [name for name in wanted.options if name.split(".")[0] in method.simulated]
    if wanted.measurements and idle:
        raise ParameterError(
            f"option {idle[0]} of {method.name} only shapes simulated experiments: leave it out "
            "for measurement files"
        )
    options = method_options(method, wanted.options)
    if not method.assembly:
        if wanted.parameters or wanted.changes:
            raise ParameterError(
                f"{method.name} needs no parameters: leave out --parameters and --set"
            )
        return Chosen(method, "", None, options, {})
    if method.bench is not None:
        bench = method.bench
        changes = parsed(type(bench.par), bench.overrides, "parameter")
        return Chosen(method, bench.parameters, bench.par, options, changes)
    found = set_for(f"method {method.name!r}", method.assembly, wanted.parameters)
    base = found.parameters()
    for name in wanted.changes:
        if name in options.flat() and name not in base.flat():
            raise unknown_name("parameter (--option sets the method's)", name, base.flat())
    changes = parsed(type(base), wanted.changes, "parameter")
    return Chosen(method, found.name, base.replace(changes), options, changes)
