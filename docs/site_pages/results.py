"""Results on pages: terminal output and figures of the commands that a page marks.

A page marks a code block by the word ``run`` after its language, and then by the names of the
figures to show. Anything else that reads the page, such as a code host, sees an ordinary block::

    ```sh run step-response
    bywire run hard-braking --out results/braking
    ```

The blocks of a page run in order, in one folder with a copy of the benches, studies, procedures and
examples of the repository. A comment ``# exit status 1`` states a status that is not 0. A block
with a caption is a file of that name.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from site_pages import fork_server

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
COLUMNS = 110  # of the terminal
FOLDERS = ("benches", "studies", "procedures", "examples")
_BLOCK = re.compile(r"^```(?P<info>[^\n`]+)\n(?P<text>.*?)^```$", re.M | re.S)
_CAPTION = re.compile(r"^:caption: (\S+)\n+", re.M)
_START = "from bywire.cli.main import process; process()"
_STATUS = "exit status 1"
ALL = ("*",)  # instead of names of figures
_NOT_PAGES = {"_build", "_generated", "trust"}


class PageError(Exception):
    """A marked block whose commands or figures do not match its page."""


@dataclass(frozen=True)
class Step:
    """A block of a page that runs, or a file that later blocks read.

    Parameters
    ----------
    language
        ``sh`` or ``python``; nothing for a file.
    text
        Content of the block.
    figures
        Names of the figures to show.
    file
        Name of the file.
    """

    language: str
    text: str
    figures: tuple[str, ...] = ()
    file: str = ""

    @property
    def commands(self) -> list[str]:
        """The command lines; a Python block is one command."""
        return [self.text] if self.language == "python" else _lines(self.text)


@dataclass(frozen=True)
class Shown:
    """What one step shows.

    Parameters
    ----------
    text
        Terminal output.
    figures
        Paths of figures that it wrote -> their file names in the folder of stored results.
    """

    text: str
    figures: dict[str, str]


def pages(folder: Path = DOCS) -> dict[str, str]:
    """Return all pages in a folder as paths from `DOCS`, without their extension -> text.

    Pages in its folder ``_generated`` are omitted.
    """
    paths = sorted(folder.rglob("*.md"))
    return {
        path.relative_to(DOCS).with_suffix("").as_posix(): path.read_text(encoding="utf-8")
        for path in paths
        if not _NOT_PAGES & set(path.relative_to(folder).parts)
    }


def steps(markdown: str) -> list[Step]:
    """Return the steps of a page, in order."""
    return [step for _, step in _marked(markdown)]


def _marked(markdown: str) -> Iterator[tuple[re.Match[str], Step]]:
    for block in _BLOCK.finditer(markdown):
        language, *words = block["info"].split()
        if words[:1] == ["run"]:
            yield block, Step(language, block["text"], tuple(words[1:]))
        elif language == "{code-block}" and (caption := _CAPTION.match(block["text"])):
            text = block["text"][caption.end() :]
            yield block, Step("", text, file=caption[1])


def play(todo: list[Step], kept: Path) -> list[Shown]:
    """Run the steps of a page and keep their figures in a folder.

    Raises
    ------
    PageError
        If a command ends with another status than stated, or does not write a figure.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        for each in FOLDERS:
            shutil.copytree(ROOT / each, folder / each)
        return [_play(step, folder, kept, f"{k + 1}") for k, step in enumerate(todo)]


def _play(step: Step, folder: Path, kept: Path, prefix: str) -> Shown:
    if step.file:
        (folder / step.file).write_text(step.text, encoding="utf-8")
        return Shown("", {})
    before = _pictures(folder)
    texts = []
    for command in step.commands:
        output = _run(step.language, command, folder)
        texts.append(f"$ {command}\n{output}" if len(step.commands) > 1 else output)
    new = {file.stem: file for file, age in _pictures(folder).items() if before.get(file) != age}
    figures = {}
    every = sorted(new, key=lambda name: name.startswith("energy"))  # what moves comes first
    for figure in every if step.figures == ALL else step.figures:
        if figure not in new:
            raise PageError(f"no new figure {figure!r}, but {sorted(new)}: {step.text}")
        file = figures[new[figure].relative_to(folder).as_posix()] = f"{prefix}-{figure}.png"
        kept.mkdir(parents=True, exist_ok=True)
        shutil.copy(new[figure], kept / file)
    return Shown("\n".join(texts).strip("\n"), figures)


def _pictures(folder: Path) -> dict[Path, int]:
    return {file: file.stat().st_mtime_ns for file in sorted(folder.rglob("*.png"))}


def _needs_shell(command: str) -> bool:
    """Return whether a command has a variable or an operator, such as a pipe."""
    words = shlex.shlex(command, posix=True, punctuation_chars=True)
    words.whitespace_split = True
    return "$" in command or any(set(word) <= set("|&;<>()") for word in words if word)


def _output(language: str, command: str, folder: Path) -> tuple[int, str]:
    """Return exit status and output of a command."""
    settings = {
        "COLUMNS": str(COLUMNS),
        "NO_COLOR": "1",
        "PYTHONUNBUFFERED": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
        "MPLBACKEND": "agg",
    }
    words: str | list[str] = command
    if language == "python":
        words = [sys.executable, "-c", command]
    elif command.startswith("bywire "):
        if fork_server.can_fork() and not _needs_shell(command):
            arguments = shlex.split(command, comments=True)[1:]
            return fork_server.run(arguments, folder, settings)
        words = f'"{sys.executable}" -c "{_START}" {command.removeprefix("bywire ")}'
    done = subprocess.run(
        words,
        shell=isinstance(words, str),
        cwd=folder,
        env={**os.environ, **settings},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    return done.returncode, done.stdout


def _run(language: str, command: str, folder: Path) -> str:
    """Run a command and return what it prints."""
    status, text = _output(language, command, folder)
    text = text.replace(f"{folder}{os.sep}", "")
    text = "\n".join(map(_wrapped, text.splitlines())).rstrip()
    if status != (1 if _STATUS in command else 0):
        raise PageError(f"exit status {status}: {command}\n{text[-2000:]}")
    return text


def _wrapped(line: str) -> str:
    """Return a line of prose, wrapped as in a terminal; table rows are not wrapped."""
    is_prose = len(line) > COLUMNS and "  " not in line.strip()
    return textwrap.fill(line, COLUMNS, break_long_words=False) if is_prose else line


def _lines(text: str) -> list[str]:
    return [line for line in text.replace("\\\n", "").splitlines() if line.strip()]


# --- All pages, and their stored results


def start(
    pool: ThreadPoolExecutor, texts: Mapping[str, str], folder: Path, sources: str
) -> dict[str, Future[list[Shown]]]:
    """Start all pages with marked blocks, in parallel processes.

    Parameters
    ----------
    texts
        Page -> its text.
    folder
        Folder of stored results, with one folder per page.
    sources
        Digest of the sources that the commands run.
    """
    return {
        page: pool.submit(_kept, todo, folder / page, sources)
        for page, text in texts.items()
        if (todo := steps(text))
    }


def _kept(todo: list[Step], folder: Path, sources: str) -> list[Shown]:
    """Return the output of the steps; run them only if they or the sources have changed."""
    content = json.dumps([sources, COLUMNS, *map(asdict, todo)])
    digest = hashlib.sha256(content.encode()).hexdigest()
    record = folder / "shown.json"
    if record.exists():
        kept = json.loads(record.read_text(encoding="utf-8"))
        if kept["digest"] == digest:
            return [Shown(**each) for each in kept["shown"]]
        shutil.rmtree(folder)
    shown = play(todo, folder)
    folder.mkdir(parents=True, exist_ok=True)
    kept = {"digest": digest, "shown": list(map(asdict, shown))}
    record.write_text(json.dumps(kept), encoding="utf-8")
    return shown


def with_results(markdown: str, shown: list[Shown], place: str) -> str:
    """Return a page with its results below the marked blocks.

    Parameters
    ----------
    shown
        Output of its steps.
    place
        Path from the page to the folder of its figures.
    """
    parts, end = [], 0
    for (block, step), result in zip(_marked(markdown), shown, strict=True):
        parts += [markdown[end : block.start()]]
        end = block.end()
        if step.file:
            parts += [block[0]]
        else:
            parts += [f"```{step.language}\n{step.text}```", *_result_lines(step, result, place)]
    return "".join([*parts, markdown[end:]])


def _result_lines(step: Step, result: Shown, place: str) -> Iterator[str]:
    if result.text:
        yield f"\n\n```{{code-block}} text\n:class: terminal\n\n{result.text}\n```"
    for path, file in result.figures.items():
        name = Path(path).stem.replace("-", " ")
        yield f"\n\n```{{figure}} {place}/{file}\n:alt: {name}\n:class: result\n\n`{path}`\n```"
