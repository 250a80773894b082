"""Try generated input: ``python tests/fuzz --seed 1 --cases 400`` (from the repository's root).

Of each kind as many cases, or those of ``--kind``; ``--first 17 --cases 1`` repeats one. What is
wrong is listed with kind and number, and the status is 1. Kills take seconds each: ``--kills 30``.
"""

from __future__ import annotations

import argparse
import faulthandler
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from random import Random

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bywire.data import limited_source
from fuzz import inputs, kills
from fuzz.judge import Verdict, judged


def bench(rng: Random, folder: Path) -> Verdict:
    """Run a generated bench file."""
    path = folder / "bench.toml"
    path.write_text(inputs.bench_text(rng), encoding="utf-8")
    return judged(["run", str(path)])


def command(rng: Random, folder: Path) -> Verdict:
    """Run a generated command line."""
    return judged(inputs.command_line(rng, folder))


def extreme(rng: Random, folder: Path) -> Verdict:
    """Run an experiment with parameters that are off by many powers of ten."""
    name = rng.choice(list(inputs.SETS))
    path = folder / "bench.toml"
    experiment = inputs.SETS[name]
    lines = [f'experiment = "{experiment}"', f'parameters = "{name}"', "[options]"]
    path.write_text("\n".join([*lines, inputs.QUICK[experiment]]), encoding="utf-8")
    sets = [word for each in inputs.extreme(rng, name) for word in ("--set", each)]
    return judged(["run", str(path), *sets])


def measurement(rng: Random, folder: Path) -> Verdict:
    """Convert, or drive a run with, a damaged file."""
    ending = rng.choice(inputs.ENDINGS)
    path = folder / f"case{ending}"
    if ending in (".csv", ".tsv") and rng.random() < 0.5:
        path.write_bytes(inputs.table(rng))
    else:
        path.write_bytes(inputs.damaged(rng, inputs.sound_file(ending, folder)))
    target = folder / "out.csv"
    target.unlink(missing_ok=True)
    if rng.random() < 0.8:
        verdict = judged(["convert", str(path), str(target)])
        is_half = target.exists() != (verdict.status == 0)
        return Verdict(verdict.status, verdict.wrong or ("half a file" if is_half else ""))
    return judged(["replay", str(path), "--bench", "hard-braking", "--input", "p_mc_set=p_mc"])


KINDS: dict[str, Callable[[Random, Path], Verdict]] = {
    "bench": bench, "command": command, "extreme": extreme, "measurement": measurement,
}  # fmt: skip


def tried(kind: str, seed: int, first: int, cases: int, seconds: float) -> list[str]:
    """Try cases of a kind and return what is wrong."""
    wrong, statuses = [], Counter[int]()
    give_up = time.process_time() + seconds
    with tempfile.TemporaryDirectory() as folder:
        for k, rng in islice(inputs.numbered(seed, kind), first, first + cases):
            if time.process_time() > give_up:
                break
            faulthandler.dump_traceback_later(300.0, exit=True)
            verdict = KINDS[kind](rng, Path(folder))
            faulthandler.cancel_dump_traceback_later()
            statuses[verdict.status] += 1
            if verdict.wrong:
                wrong.append(f"{kind} {k} of seed {seed}: {verdict.wrong}")
                print(wrong[-1], flush=True)
    counts = ", ".join(f"{n} with status {s}" for s, n in sorted(statuses.items()))
    print(f"{kind}: {statuses.total()} cases: {counts}; wrong: {len(wrong)}", flush=True)
    return wrong


def killed(seed: int, first: int, cases: int) -> list[str]:
    """Kill and interrupt commands and return what is wrong."""
    wrong = []
    for k, rng in islice(inputs.numbered(seed, "kill"), first, first + cases):
        with tempfile.TemporaryDirectory() as folder:
            found = kills.case(rng, Path(folder))
        if found:
            wrong.append(f"kill {k} of seed {seed}: {found}")
            print(wrong[-1], flush=True)
    print(f"kill: {cases} cases; wrong: {len(wrong)}", flush=True)
    return wrong


def main() -> int:
    """Try what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python tests/fuzz")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=100, help="of each kind")
    parser.add_argument("--seconds", type=float, default=1e9, help="of a processor, each kind")
    parser.add_argument("--kind", choices=list(KINDS), action="append")
    parser.add_argument("--kills", type=int, default=0)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    limited_source.SECONDS = 5.0
    wrong: list[str] = []
    for kind in asked.kind or KINDS:
        wrong += tried(kind, asked.seed, asked.first, asked.cases, asked.seconds)
    if asked.kills:
        wrong += killed(asked.seed, asked.first, asked.kills)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
