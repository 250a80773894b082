"""Tab completion in the shell for names from the cached index and for files."""

from __future__ import annotations

from collections.abc import Callable
from glob import escape, iglob
from os.path import isdir

Completed = list[tuple[str, str]]
"""words that a shell suggests, each with its meaning"""


def names_of(*kinds: str, ending: str = "") -> Callable[[str], Completed]:
    """Return a completer for names in some topics, and for files with a given suffix.

    Parameters
    ----------
    kinds
        Topics, for example ``"experiments"`` (see `bywire.overview`). Default: all.
    ending
        Suffix of files, for example ``".toml"``. If empty, no files are completed.
    """

    def completed(incomplete: str) -> Completed:
        from bywire.api.overview import overview

        things = overview().things
        known = {
            name: text
            for kind in kinds or things
            for name, text in _texts(things[kind]).items()
            if isinstance(text, str)
        }
        fitting = [(name, known[name]) for name in sorted(known) if name.startswith(incomplete)]
        return fitting + (_files(incomplete, ending) if ending else [])

    return completed


def _texts(things: dict[str, str] | list[str]) -> dict[str, str]:
    return things if isinstance(things, dict) else dict.fromkeys(things, "")


def _files(incomplete: str, ending: str) -> Completed:
    """Return folders, and files with a suffix, whose paths start with the incomplete one."""
    paths = sorted(iglob(f"{escape(incomplete)}*"))
    return [
        (f"{path}/" if isdir(path) else path, "")
        for path in paths
        if isdir(path) or path.endswith(ending)
    ]


def changeable(args: list[str], incomplete: str) -> Completed:
    """Complete the key of ``KEY=VALUE`` from a bench's parameters and options.

    For commands without a bench, such as those of loops, complete from all parameter sets.
    """
    from bywire.core.errors import BywireError

    if "=" in incomplete:
        return []  # values are free text
    named = next((word for word in args if not word.startswith("-")), "")
    try:
        keys = _keys_of(named)
    except BywireError:
        keys = _all_parameters()
    return [(f"{key}=", text) for key, text in keys.items() if key.startswith(incomplete)]


def varied(args: list[str], incomplete: str) -> Completed:
    """Complete a parameter's name."""
    return [(key.removesuffix("="), text) for key, text in changeable(args, incomplete)]


def _keys_of(bench: str) -> dict[str, str]:
    """Return a bench's parameters and options with their values."""
    from bywire.bench.bench_file import read
    from bywire.bench.changes import OPTION

    made = read(bench, {})
    options = {f"{OPTION}{name}": value for name, value in made.chosen_options.flat().items()}
    known = {**made.par.flat(), **options}
    return {name: f"{value!r} in SI" for name, value in known.items()}


def _all_parameters() -> dict[str, str]:
    from bywire.core.catalog import PARAMETER_SETS

    sets = PARAMETER_SETS.all().values()
    return {name: cited.name for cited in sets for name in cited.parameters().flat()}
