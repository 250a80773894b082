"""Try generated input: ``python tests/fuzz --seed 1 --cases 400`` (from the repository's root).

Of each kind as many cases, or those of ``--kind``, all in one process; ``--first 17 --cases 1``
repeats one. Benches and commands are admissible but for a quarter, which has a defect; how many of
the others gave a result is said. What is wrong is listed with kind and number, and the status is 1.
Seconds each take commands that are killed or interrupted (``--kills 30 --interrupts 30``), and
those that are compared with the same in a process of its own (``--alone 30``), and studies whose
processes are killed up to eight times each (``--studies 10``).
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import math
import shutil
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from random import Random

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bywire.data import limited_source
from bywire.usecases.study import run_study
from fuzz import failing, inputs, kills, layouts, options, plans, sound, study_kills
from fuzz.judge import Verdict, judged, judged_alone


def bench(rng: Random, folder: Path) -> Verdict:
    """Run a generated bench file."""
    path = folder / "bench.toml"
    text, is_sound = inputs.bench_text(rng)
    path.write_text(text, encoding="utf-8")
    return replace(judged(["run", str(path)]), is_sound=is_sound)


def command(rng: Random, folder: Path) -> Verdict:
    """Run a generated command line."""
    words, is_sound = inputs.command_line(rng, folder)
    return replace(judged(words), is_sound=is_sound)


def extreme(rng: Random, folder: Path) -> Verdict:
    """Run an experiment with parameters that are off by many powers of ten."""
    trial, name, entries = sound.quick(rng)
    path = folder / "bench.toml"
    path.write_text(sound.as_toml(rng, trial.experiment, name, entries), encoding="utf-8")
    return judged(["run", str(path), *inputs.extreme(rng, name)])


def measurement(rng: Random, folder: Path) -> Verdict:
    """Convert, or drive a run with, a damaged file."""
    ending = rng.choice(inputs.ENDINGS)
    path = folder / f"case{ending}"
    if ending in (".csv", ".tsv") and rng.random() < 0.5:
        path.write_bytes(inputs.table(rng))
    else:
        content = inputs.sound_file(ending, folder)
        path.write_bytes(content if rng.random() < 0.3 else inputs.damaged(rng, content))
    target = folder / "out.csv"
    target.unlink(missing_ok=True)
    if rng.random() < 0.8:
        verdict = judged(["convert", str(path), str(target)])
        is_half = target.exists() != (verdict.status == 0)
        return Verdict(verdict.status, verdict.wrong or ("half a file" if is_half else ""))
    return judged(["replay", str(path), "--bench", "hard-braking", "--input", "p_mc_set=p_mc"])


def faulty(rng: Random, folder: Path) -> Verdict:
    """Run a bench with generated faults."""
    path = folder / "bench.toml"
    path.write_text(failing.bench_text(rng), encoding="utf-8")
    return judged(["run", str(path)])


def campaign(rng: Random, folder: Path) -> Verdict:
    """Run a generated campaign of faults."""
    path = folder / "campaign.toml"
    path.write_text(failing.campaign_text(rng), encoding="utf-8")
    return judged(["faults", str(path)])


def study(rng: Random, folder: Path) -> Verdict:
    """Run a generated study."""
    text, is_sound = plans.study_text(rng)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    verdict = judged(["study", "run", str(folder / "study.toml"), "--out", str(folder / "study")])
    shutil.rmtree(folder / "study", ignore_errors=True)
    return replace(verdict, is_sound=is_sound)


def life(rng: Random, folder: Path) -> Verdict:
    """Project a generated life."""
    text, is_sound = plans.life_text(rng)
    (folder / "life.toml").write_text(text, encoding="utf-8")
    return replace(judged(["life", str(folder / "life.toml")]), is_sound=is_sound)


def option(rng: Random, folder: Path) -> Verdict:
    """Run a command with a value that is too large, too small or not a number at all."""
    if not (folder / "measured.csv").exists():
        options.prepared(folder)
        run_study(folder / "study.toml", folder / "studied", cases=4, workers=1)
    return judged(options.command_line(rng))


KINDS: dict[str, Callable[[Random, Path], Verdict]] = {
    "bench": bench,
    "command": command,
    "extreme": extreme,
    "measurement": measurement,
    "faulty": faulty,
    "campaign": campaign,
    "study": study,
    "life": life,
    "option": option,
    "layout": layouts.case,
}


LEAST = 4
"""cases that are tried however long they take: on a busy machine one may use all of the time"""


def tried(kind: str, seed: int, first: int, cases: int, seconds: float) -> tuple[list[str], float]:
    """Try cases of a kind and return what is wrong, and the share of sound ones with a result."""
    wrong, statuses, through = [], Counter[int](), Counter[bool]()
    give_up = time.process_time() + seconds
    # There, too, lands what a command writes whose --out took the next word for a folder.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for k, rng in islice(inputs.numbered(seed, kind), first, first + cases):
            if time.process_time() > give_up and statuses.total() >= LEAST:
                break
            faulthandler.dump_traceback_later(300.0, exit=True)
            verdict = KINDS[kind](rng, Path(folder))
            faulthandler.cancel_dump_traceback_later()
            statuses[verdict.status] += 1
            if verdict.is_sound:
                through[verdict.status in (0, 1)] += 1
            if verdict.wrong:
                wrong.append(f"{kind} {k} of seed {seed}: {verdict.wrong}")
                print(wrong[-1], flush=True)
    counts = ", ".join(f"{n} with status {s}" for s, n in sorted(statuses.items()))
    if through:
        counts += f"; {through[True]} of {through.total()} sound ones gave a result"
    print(f"{kind}: {statuses.total()} cases: {counts}; wrong: {len(wrong)}", flush=True)
    return wrong, through[True] / through.total() if through else math.nan


def each_in(
    kind: str, seed: int, first: int, cases: int, case: Callable[[Random, Path], str]
) -> list[str]:
    """Try cases in a folder each, and return what is wrong."""
    wrong = []
    for k, rng in islice(inputs.numbered(seed, kind), first, first + cases):
        with tempfile.TemporaryDirectory() as folder:
            found = case(rng, Path(folder))
        if found:
            wrong.append(f"{kind} {k} of seed {seed}: {found}")
            print(wrong[-1], flush=True)
    print(f"{kind}: {cases} cases; wrong: {len(wrong)}", flush=True)
    return wrong


def alone(rng: Random, folder: Path) -> str:
    """Run a command here and in a process of its own."""
    return judged_alone(inputs.command_line(rng, folder)[0])


ONE_BY_ONE: dict[str, Callable[[Random, Path], str]] = {
    "kills": partial(kills.case, sign=signal.SIGKILL, forked=True),
    "interrupts": partial(kills.case, sign=signal.SIGINT, forked=True),
    "alone": alone,
    "studies": partial(study_kills.case, forked=True),
}


def main() -> int:
    """Try what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python tests/fuzz")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=100, help="of each kind")
    parser.add_argument("--seconds", type=float, default=1e9, help="of a processor, each kind")
    parser.add_argument("--kind", choices=list(KINDS), action="append")
    for kind in ONE_BY_ONE:
        parser.add_argument(f"--{kind}", type=int, default=0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    limited_source.SECONDS = 20.0
    wrong: list[str] = []
    for kind in asked.kind or KINDS:
        wrong += tried(kind, asked.seed, asked.first, asked.cases, asked.seconds)[0]
    for kind, case in ONE_BY_ONE.items():
        if count := getattr(asked, kind):
            wrong += each_in(kind, asked.seed, asked.first, count, case)
    if study_kills.KILLED:
        print("killed:", ", ".join(f"{n} {what}" for what, n in study_kills.KILLED.items()))
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
