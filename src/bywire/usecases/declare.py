"""Declare a use case as an annotated function, from which its command and form are generated.

An argument's annotation contains its type and an `Ask`: the flag's help, the label and hint of the
form's field, and the shell completions. The docstring's first line is the summary, which appears in
the command's help, the form and the reference. In messages, `bywire.core.callers.option` writes an
argument's name.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ForwardRef, Literal, get_args, get_origin

from bywire.core.callers import name_flag
from bywire.report.answering import Asked, Given, answering

Kind = Literal[
    "text",
    "whole",
    "lines",
    "pairs",
    "changes",
    "names",
    "flag",
    "choice",
    "file",
    "files",
    "thing",
    "things",
]
"""kinds of form fields (see `bywire.server.field`)"""
_EXAMPLE = re.compile(
    r"(?:e\.g\.|such as|for example|:) '([^']+)'"
    r"|(?:e\.g\.|such as|for example) (\S+?)(?=[,;.)]*(?:\s|$))"
)
NOTHING: Mapping[str, Any] = MappingProxyType({})
"""default of arguments that map names to values"""


@dataclass(frozen=True)
class Ask:
    """Texts and valid values for an argument's command flag and form field.

    Parameters
    ----------
    help
        Help text of the flag, and hint of the field.
    label
        Label of the field. An argument without a label has no field.
    name
        Name of the flag and the field, if it differs from the argument's name.
    kind
        Kind of the field, if it does not follow from the type.
    metavar
        Placeholder of the value in the command's help. By default, derived from the type.
    known
        Topics of `bywire.overview` whose names are valid and which the shell completes.
    files
        Suffix of files that are also valid, for example ``".toml"``.
    offered
        Parts of `bywire.server.contents.Contents` that the form offers.
    words
        All valid words: a tuple, or a function that returns them.
    completes
        Names that the shell completes: ``"changes"`` or ``"parameters"`` of a bench.
    least, most
        Range of a whole number.
    ticked
        Value that a checkbox in the form sets, instead of a field for any value.
    is_flag
        Whether a required argument is a flag of the command.
    is_positional
        Whether an argument with a default is a positional argument of the command.
    is_listing
        Whether the command accepts a comma-separated list instead of repeated flags.
    is_text
        Whether the command passes a string where the function also accepts a path.
    is_folder
        Whether the argument is a folder to which the command writes.
    is_last
        Whether the command's help lists the argument after all others.
    shown_default
        Text shown for the default in the command's help. If None, the default itself.
    panel
        Heading in the command's help under which the argument appears.
    """

    help: str
    label: str = ""
    name: str = ""
    kind: Kind | None = None
    metavar: str | None = None
    known: tuple[str, ...] = ()
    files: str = ""
    offered: tuple[str, ...] = ()
    words: tuple[str, ...] | Callable[[], Sequence[str]] = ()
    completes: Literal["", "changes", "parameters"] = ""
    least: int | None = None
    ticked: str = ""
    is_flag: bool = False
    is_positional: bool = False
    is_listing: bool = False
    is_text: bool = False
    is_folder: bool = False
    is_last: bool = False
    shown_default: str | bool | None = None
    panel: str | None = None

    @property
    def example(self) -> str:
        """First example in the help text, which an empty form field shows. May be empty."""
        found = _EXAMPLE.search(self.help)
        return (found[1] or found[2]) if found else ""


@dataclass(frozen=True)
class Command:
    """Command for a use case.

    Parameters
    ----------
    words
        Words that the user types after ``bywire``.
    help
        Help text of the command. Default: the use case's summary.
    status_1
        End of the sentence "Exits with status 1 ...".
    before
        ``before(**asked)`` rejects invalid arguments before the command creates the result folder.
    writes
        Argument that contains the result folder. Empty if the command writes no result. The command
        gets an ``--out`` flag if no argument is named ``out``.
    default_folder
        ``default_folder(**asked)`` returns the folder if the user specifies none.
    advice
        Advice to the user if the folder is not writable.
    first
        Arguments that the help lists first.
    without
        Arguments for which this command has no flag.
    required
        Arguments that this command requires although they have a default, with their help texts.
    """

    words: str
    help: str = ""
    status_1: str = ""
    before: Callable[..., None] | None = None
    writes: str = "out"
    default_folder: Callable[..., Path] | None = None
    advice: str = ""
    first: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    required: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Form:
    """Form of a use case in ``bywire serve``.

    Parameters
    ----------
    title, action
        Heading of the form, and label of its button.
    subject
        Field after which the result folder is named.
    name
        Name of the task. Default: the words of the command.
    fields
        Fields in the order shown. Default: all arguments with a label.
    is_listed
        Whether the start page links to a separate page for the form.
    is_kept
        Whether another run of the same subject continues in the same folder.
    is_file
        Whether ``out`` is a file that the use case writes itself.
    """

    title: str
    action: str
    subject: str = "bench"
    name: str = ""
    fields: tuple[str, ...] = ()
    is_listed: bool = True
    is_kept: bool = False
    is_file: bool = False


@dataclass(frozen=True)
class Argument:
    """Argument of a use case.

    Parameters
    ----------
    argument
        Name in Python.
    ask
        Texts and valid values for the flag and the field.
    type, default
        From the function's signature.
    is_many
        Whether it accepts any number of positional arguments.
    """

    argument: str
    ask: Ask
    type: Any
    default: Any
    is_many: bool

    @property
    def name(self) -> str:
        """Name of the field, and of the flag without its dashes."""
        return self.ask.name or self.argument

    @property
    def flag(self) -> str:
        """Flag of the command."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def is_required(self) -> bool:
        """Whether there is no default."""
        return self.default is inspect.Parameter.empty

    @property
    def is_positional(self) -> bool:
        """Whether the command accepts the argument without a flag."""
        return self.is_many or self.ask.is_positional or (self.is_required and not self.ask.is_flag)

    @property
    def is_path(self) -> bool:
        """Whether the command reads the value as a path."""
        names = str(self.type)
        return "Path" in names and not self.ask.is_text

    @property
    def kind(self) -> Kind:
        """Kind of the field. The command reads its flag the same way, except for `ticked`."""
        ask, outer = self.ask, get_origin(self.type)
        if ask.kind is not None:
            return ask.kind
        if self.is_many:
            return "things"
        if ask.offered:
            return "thing"
        if ask.known or ask.words:
            return "choice"
        kinds: dict[Any, Kind] = {
            Mapping: "changes",
            Sequence: "lines",
            bool: "flag",
            int: "whole",
        }
        parts = (self.type, outer, *get_args(self.type), *map(get_origin, get_args(self.type)))
        return next((kinds[part] for part in parts if part in kinds), "text")


@dataclass(frozen=True)
class UseCase:
    """Declared use case (see `use_case`).

    Parameters
    ----------
    public, function
        The public function, and the function that the command and the form call (usually the same).
    arguments
        Arguments of the command and the form.
    commands, form, check, holds
        See `use_case`.
    takes
        Names of all arguments of ``function``.
    """

    public: Callable[..., Any]
    function: Callable[..., Any]
    arguments: tuple[Argument, ...]
    commands: tuple[Command, ...]
    form: Form | None
    check: Callable[..., Any] | None
    holds: Callable[[Path, Any], bool] | None
    takes: frozenset[str]

    @property
    def name(self) -> str:
        """Name in Python."""
        return self.public.__name__

    @property
    def summary(self) -> str:
        """First line of the docstring."""
        return (inspect.getdoc(self.public) or "").partition("\n")[0]

    def call(self, asked: Mapping[str, Any], **more: Any) -> Any:
        """Call the function with the fields' values by name and with additional arguments."""
        others = {name: value for name, value in more.items() if name in self.takes}
        given = {a.argument: asked[a.name] for a in self.arguments if a.name in asked}
        many = [value for a in self.arguments if a.is_many for value in given.pop(a.argument, ())]
        return self.function(*many, **given, **others)

    def read(self, asked: Mapping[str, Any]) -> Any:
        """Check the fields' values by name without computing anything.

        Raises
        ------
        InputError
            If a value is invalid.
        """
        if self.check is None:
            return None
        taken = inspect.signature(self.check).parameters
        given = {
            a.argument: asked.get(a.name, a.default) for a in self.arguments if a.argument in taken
        }
        many = [value for a in self.arguments if a.is_many for value in given.pop(a.argument, ())]
        return self.check(*many, **given)


DECLARED: dict[str, UseCase] = {}
"""use cases declared so far, by function name"""


def use_case(
    *commands: str | Command,
    form: Form | None = None,
    check: Callable[..., Any] | None = None,
    holds: Callable[[Path, Any], bool] | None = None,
    asked: Callable[..., Any] | None = None,
) -> Callable[[Callable[Asked, Given]], Callable[Asked, Given]]:
    """Declare a function as a use case that checks its arguments and emits the result's warnings.

    Parameters
    ----------
    commands
        Commands, each as a `Command` or as the words after ``bywire``.
    form
        Form of the use case.
    check
        ``check(...)`` accepts any of the arguments and checks them without computing anything.
    holds
        ``holds(folder, read)`` returns whether a folder contains results for the value that
        ``check`` returned, so that the command can continue there.
    asked
        Function that the command and the form call, with the arguments that they offer. Default:
        the public function.
    """

    def declare(function: Callable[Asked, Given]) -> Callable[Asked, Given]:
        public = answering(function)
        called = public if asked is None else asked
        arguments = tuple(_arguments(function if asked is None else asked))
        setattr(public, "__signature__", _bare_signature(function))  # noqa: B010
        made = tuple(Command(each) if isinstance(each, str) else each for each in commands)
        takes = frozenset(inspect.signature(called).parameters)
        case = UseCase(public, called, arguments, made, form, check, holds, takes)
        for each in arguments:
            if not each.is_positional:
                name_flag(each.argument, each.flag)
        DECLARED[case.name] = case
        return public

    return declare


def _arguments(function: Callable[..., Any]) -> list[Argument]:
    found = []
    for name, each in inspect.signature(function).parameters.items():
        if get_origin(each.annotation) is Annotated:
            kind, ask = get_args(each.annotation)[:2]
            found.append(Argument(name, ask, kind, each.default, each.kind is each.VAR_POSITIONAL))
    return found


def _bare_signature(function: Callable[..., Any]) -> inspect.Signature:
    """Return a signature with plain types as strings, for `help` and argument checks."""
    written = inspect.signature(function)
    bare = [p.replace(annotation=_bare(p.annotation)) for p in written.parameters.values()]
    return written.replace(parameters=bare)


def _bare(annotation: Any) -> str:
    kind = get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation
    if isinstance(kind, str | ForwardRef):
        return kind if isinstance(kind, str) else kind.__forward_arg__
    return (
        inspect.formatannotation(kind)
        .replace("typing.", "")
        .replace("pathlib._local.", "pathlib.")  # Python 3.13
        .replace("pathlib.", "")
        .replace("collections.abc.", "")
    )
