"""Program: kill a sign-off many times at random moments, then let it finish (see test_kills)."""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from pathlib import Path

from bywire.api.signoff import SignOff
from bywire.core.typing import silent
from bywire.signoff.signoff_file import read_signoff
from bywire.signoff.store import EvidenceStore
from signoff.closed_form import READERS


def signed(file: Path, out: Path) -> None:
    """Sign a file off in this process."""
    plan, store = read_signoff(file, READERS), EvidenceStore(out)
    kept = {}
    for digest, task in plan.tasks.items():
        found = store.kept(task)
        if found is None:
            store.keep(task, task.compute(store.place(task), silent))
            found = store.kept(task)
        assert found is not None
        kept[digest] = found
    SignOff(plan, store.folder, kept).write(out)


def main(file: Path, out: Path, kills: int) -> None:
    """Kill ``kills`` runs, then complete one."""
    choose = random.Random(kills)
    for _ in range(kills):
        child = os.fork()
        if child == 0:
            signed(file, out)
            os._exit(0)
        time.sleep(choose.uniform(0.0, 0.03))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    signed(file, out)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
