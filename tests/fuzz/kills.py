"""Commands that write, ended anywhere: one whole result, or a word that it is not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from random import Random

from bywire.campaigns.running import CampaignStore
from bywire.core.scratch import PREFIX, UNFINISHED
from bywire.report.result_folder import earlier_files
from bywire.studies.store import StudyStore
from fuzz import options
from fuzz.forked import Forked
from fuzz.judge import judged

WRITERS = {
    "run": ["run", "hard-braking", "--set", "options.duration=40 ms", "--out", "{out}"],
    "ramp": [
        "run",
        "friction-ramp",
        "--set",
        "options.slope=2 A/s",
        "--set",
        "options.i_max=0.1 A",
        "--out",
        "{out}",
    ],
    "stribeck": ["run", "seal-stribeck", "--out", "{out}"],
    "identify": ["identify", "seal-friction", "--synthetic", "1", "--out", "{out}"],
    "study": ["identify", "seal-friction", "--study", "3", "--out", "{out}"],
    "margins": ["margins", "pressure", "--out", "{out}"],
    "linearize": ["linearize", "motorcycle-plant", "--out", "{out}"],
    "new": ["new", "{name}"],
    "stability": ["study", "stability", "--out", "{out}"],
    "design": ["design", "current", "--require", "bandwidth >= 10 Hz", "--out", "{out}"],
    "life": ["life", "wedge-pads", "--set", "wear.mechanism=none", "--out", "{out}"],
    "faults": ["faults", "{folder}/campaign.toml", "--out", "{out}"],
    "tolerances": ["study", "run", "{folder}/study.toml", "--out", "{out}"],
    "resume": ["study", "resume", "{out}"],
    "reproduce": ["reproduce", "roberts2003", "--out", "{out}"],
    "replay": [
        "replay",
        "{folder}/measured.csv",
        "--bench",
        "hard-braking",
        "--input",
        "p_set=p_mc",
        "--out",
        "{out}",
    ],
    "agreement": ["agreement", "current", "--frequencies", "100 Hz, 200 Hz", "--out", "{out}"],
    "compare": [
        "compare",
        "hard-braking",
        "release",
        "--set",
        "options.duration=40 ms",
        "--out",
        "{out}",
    ],
    "check": ["check", "adc", "--out", "{out}"],
}
_LONGEST = 120.0
_CASES = 600  # of a study that goes on: several chunks
_FORKED = 0.9  # of the commands
_LATEST = {True: 1.5, False: 6.0}  # s after which they are ended: copies of this process are loaded


def started(words: list[str], folder: Path, temporary: Path) -> Forked:
    """Start a command in a copy of this process."""
    return Forked(words, folder / "errors", folder, temporary)


def command(words: list[str], folder: Path, env: dict[str, str]) -> subprocess.Popen[str]:
    """Start a command in a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "bywire.cli", *words],
        cwd=folder,
        env=env,
        text=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def case(
    rng: Random, folder: Path, sign: signal.Signals | None = None, forked: bool = False
) -> str:
    """Write a result, end the writing of another midway, and say what is wrong with the folder.

    ``forked``: whether most commands are copies of this process, a few times as quick.
    """
    sign = sign or rng.choice((signal.SIGINT, signal.SIGKILL))
    out, temporary = folder / "out", folder / "tmp"
    temporary.mkdir()
    options.prepared(folder)
    paths = os.pathsep.join(filter(None, sys.path))
    env = {**os.environ, "TMPDIR": str(temporary), "PYTHONPATH": paths}
    names = rng.sample(["run", "ramp", "stribeck", "margins"], 2)
    second = rng.choice([names[1], *WRITERS]) if rng.random() < 0.5 else names[1]
    if second == "resume":
        _begun(out)
    elif rng.random() < 0.7:
        made = judged(_words(names[0], out))  # here, which is quicker
        assert made.status in (0, 1, 2), made.wrong
    before = _listing(out)
    forked = forked and rng.random() < _FORKED
    words = _words(second, out)
    process: Forked | subprocess.Popen[str]
    with started(words, folder, temporary) if forked else command(words, folder, env) as process:
        time.sleep(rng.uniform(0.02 if forked else 0.1, _LATEST[forked]))
        process.send_signal(sign)
        try:
            _, said = process.communicate(timeout=_LONGEST)
        except subprocess.TimeoutExpired:
            process.kill()
            return f"{second}: does not end after {sign.name}"
    is_late = process.returncode in (0, 1)
    is_refused = process.returncode == 2 and "choose another folder" in said
    if sign == signal.SIGINT and not is_late and not is_refused:
        # Before Python has come to the command, it ends by the signal itself.
        is_early = process.returncode == -signal.SIGINT and "bywire" not in said
        if not is_early and (process.returncode != 130 or "Traceback" in said):
            return f"{second}: status {process.returncode} after Ctrl-C: {said[-800:]}"
    wrong = _half(out, before)
    if wrong:
        return f"{second} after {names[0]}, {sign.name}: {wrong}"
    words = _words("stribeck", out)
    _finished(started(words, folder, temporary) if forked else command(words, folder, env))
    left = [p.name for p in (*temporary.iterdir(), *out.rglob("*")) if p.name.startswith(PREFIX)]
    return f"{second}: {left} stay after the next run" if left else _half(out, before)


def _words(name: str, out: Path) -> list[str]:
    return [word.format(out=out, folder=out.parent, name="drum") for word in WRITERS[name]]


def _begun(out: Path) -> None:
    """Have a folder hold a study of which some cases are still to be computed."""
    made = judged([*_words("tolerances", out), "--cases", str(_CASES)])
    assert made.status in (0, 1), made.wrong
    for chunk in sorted((out / "chunks").iterdir())[1:]:
        chunk.unlink()


def _finished(process: Forked | subprocess.Popen[str]) -> None:
    _, said = process.communicate(timeout=_LONGEST)
    assert process.returncode in (0, 1, 2), said


def _listing(out: Path) -> set[str]:
    return {p.name for p in out.iterdir() if p.is_file()} if out.exists() else set()


def _half(out: Path, before: set[str]) -> str:
    """Return why a folder is neither one result nor marked as none."""
    names = _listing(out)
    if not out.exists() or UNFINISHED in names or names == before:
        return ""
    ours = earlier_files(out)
    kept = {StudyStore.RECORD, CampaignStore.RECORD}  # whose finished pieces lie beside a result
    stored = {name for name in names if name.endswith(".jsonl") or name in kept}
    return (
        f"{sorted(names)}, of which {sorted(ours)} are one result" if names - stored != ours else ""
    )
