"""Renew stored screenshots of pages: ``python tests/screenshots [NAME ...]`` (from the root).

All, or those of the names. What changed is said, the others stay; look at the files before they
are committed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

if __package__ in (None, ""):
    tests = Path(__file__).resolve().parents[1]
    sys.path[:0] = [str(tests.parent), str(tests)]

from benchmarks.browser import browser
from screenshots.compared import difference
from screenshots.subjects import SUBJECTS, without_site
from screenshots.taken import path_of, store, stored, taken


def main() -> int:
    """Take the screenshots that are asked for, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=[[], *SUBJECTS], default=[], metavar="NAME")
    names = parser.parse_args().names or list(SUBJECTS)
    with tempfile.TemporaryDirectory() as folder, browser() as opened:
        for name in names:
            if name == "site" and (reason := without_site()):
                print(f"{name}: left as it is: {reason}")
                continue
            subject, place = SUBJECTS[name], Path(folder) / name
            place.mkdir()
            address = subject.write(place).as_uri()
            for theme, shot in taken(opened, address, subject.width, subject.ready).items():
                label = f"{name}-{theme}"
                old = stored(label) if path_of(label).exists() else shot[:0]
                if difference(old, shot).is_seen:
                    size = store(label, shot).stat().st_size
                    print(f"{label}: changed, {size / 1e3:.0f} kB")
                else:
                    print(f"{label}: as it was")
    return 0


if __name__ == "__main__":
    sys.exit(main())
