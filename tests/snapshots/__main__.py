"""Renew what is kept of what users see: ``python tests/snapshots [GROUP ...]`` (from the root).

What changed by more than the last digits of numbers is said and written; read it before it is
committed. With ``--check`` nothing is written, and the status is 1 where something changed.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from snapshots.compared import difference
from snapshots.subjects import GROUPS

STORED = Path(__file__).parent / "stored"


def main() -> int:
    """Write what changed, or only say it, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("groups", nargs="*", choices=[[], *GROUPS], default=[], metavar="GROUP")
    parser.add_argument("--check", action="store_true", help="write nothing")
    asked = parser.parse_args()
    changed = False
    for group in asked.groups or list(GROUPS):
        folder = STORED / group
        folder.mkdir(parents=True, exist_ok=True)
        gone = {path.name for path in folder.iterdir()}
        for name, text in GROUPS[group]():
            path = folder / f"{name}.txt"
            gone.discard(path.name)
            if found := difference(path.read_text() if path.exists() else "", text):
                changed = True
                print(f"{group}/{name}: {found}")
                if not asked.check:
                    path.write_text(text)
        for name in gone:
            changed = True
            print(f"{group}/{name}: is gone")
            if not asked.check:
                (folder / name).unlink()
    return 1 if changed and asked.check else 0


if __name__ == "__main__":
    sys.exit(main())
