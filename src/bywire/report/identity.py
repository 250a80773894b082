"""Identity of a report: date, user, version, command and input files."""

from __future__ import annotations

import getpass
import hashlib
import os
import shlex
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from bywire.core.callers import is_command_line
from bywire.core.version import __version__
from bywire.report.wording import clean

_DIGITS = 12  # digits of a digest or a commit: enough to distinguish files and commits
_LARGEST = 64 * 2**20  # bytes of a hashed input file: a larger one would delay the report
_COMMIT = frozenset("0123456789abcdef")


def identity() -> list[tuple[str, str]]:
    """Return the identity of a report that is written now, as pairs of label and text.

    ``SOURCE_DATE_EPOCH``, the environment variable of reproducible builds, sets the date.
    """
    rows = [
        ("date", _date()),
        ("by", _person()),
        ("bywire", __version__),
        ("commit", commit(Path.cwd())),
    ]
    words = sys.argv[1:]
    if is_command_line() and words[:1] != ["serve"]:  # its forms start other commands
        rows.append(("command", shlex.join(["bywire", *words])))
        rows += [("input", text) for text in _inputs(words)]
    else:
        rows.append(("command", "called from Python or from a bywire serve form"))
    return [(label, clean(text)) for label, text in rows if text]


def today() -> str:
    """Return the date of a report that is written now, as in `identity`."""
    return _date()[: len("2000-01-01")]


def _date() -> str:
    fixed = os.environ.get("SOURCE_DATE_EPOCH", "")
    if fixed.isdecimal():
        return datetime.fromtimestamp(int(fixed), UTC).strftime("%Y-%m-%d %H:%M UTC")
    return time.strftime("%Y-%m-%d %H:%M %z")


def _person() -> str:
    """Return the user's name; empty if the system does not have it."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a user without an account entry, as in some containers
        return ""


def commit(folder: Path) -> str:
    """Return the current commit of a folder's Git repository; empty without one.

    This reads the files of the repository and does not start Git: the settings of somebody else's
    folder may name programs that Git would run.
    """
    for place in (folder, *folder.parents):
        git = place / ".git"
        try:
            if git.is_file():  # a linked working tree
                named = git.read_text(encoding="utf-8").removeprefix("gitdir:").strip()
                return _head(place / named)
            if git.is_dir():
                return _head(git)
        except (OSError, UnicodeDecodeError):
            return ""
    return ""


def _head(git: Path) -> str:
    head = (git / "HEAD").read_text(encoding="utf-8").strip()
    if not head.startswith("ref:"):
        return _short(head)
    name = head.removeprefix("ref:").strip()
    if ".." in name or name.startswith("/"):
        return ""
    shared = git / "commondir"
    places = [git, git / shared.read_text(encoding="utf-8").strip()] if shared.is_file() else [git]
    for place in places:
        if (place / name).is_file():
            return _short((place / name).read_text(encoding="utf-8").strip())
        packed = place / "packed-refs"
        if packed.is_file():
            for line in packed.read_text(encoding="utf-8").splitlines():
                number, _, called = line.partition(" ")
                if called == name:
                    return _short(number)
    return ""


def _short(number: str) -> str:
    """Return the first digits of a commit; empty for a text that is not one."""
    return number[:_DIGITS] if len(number) >= 40 and _COMMIT.issuperset(number) else ""


def _inputs(words: Sequence[str]) -> list[str]:
    """Return the files in a command, each with the first digits of its SHA-256 digest."""
    texts = []
    for word in words:
        path = Path(word)
        try:
            if path.is_file() and path.stat().st_size <= _LARGEST:
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
                texts.append(f"{word} (SHA-256 {digest[:_DIGITS]})")
        except (OSError, ValueError):  # too long for a path, or with a null character
            continue
    return texts
