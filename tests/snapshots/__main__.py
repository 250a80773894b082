"""Renew what is kept of what users see: ``python tests/snapshots [GROUP ...]`` (from the root).

What changed by more than the last digits of numbers is said and written; read it before it is
committed.
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
    """Write what changed, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("groups", nargs="*", choices=[[], *GROUPS], default=[], metavar="GROUP")
    for group in parser.parse_args().groups or list(GROUPS):
        folder = STORED / group
        folder.mkdir(parents=True, exist_ok=True)
        left = {path.name for path in folder.iterdir()}
        for name, text in GROUPS[group]():
            path = folder / f"{name}.txt"
            left.discard(path.name)
            if found := difference(path.read_text() if path.exists() else "", text):
                path.write_text(text)
                print(f"{group}/{name}: {found}")
        for name in left:
            (folder / name).unlink()
            print(f"{group}/{name}: is gone")
    return 0


if __name__ == "__main__":
    sys.exit(main())
