"""Helpers that tests of the command line share: outcomes, and bench files to start from."""

from __future__ import annotations

import json
import sysconfig
from pathlib import Path
from typing import Any, NamedTuple

SCRIPT = Path(sysconfig.get_path("scripts")) / "bywire"
BRAKING = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
OPEN_LOOP = 'experiment = "motor-open-loop"\nparameters = "dardanelli2010"\n'
PEDAL = 'experiment = "pedal-tracking"\nparameters = "dardanelli2010"\n'
QUICK = '\n[options]\nduration = "40 ms"\nsettle = "10 ms"\n'
LONG = (
    'experiment = "friction-ramp"\nparameters = "dardanelli2010"\n'
    '[options]\nslope = "0.005 A/s"\n[simulation]\nrecord = "10 ms"\n'
)


class Outcome(NamedTuple):
    """Outcome of a command."""

    status: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        """Lines of standard error."""
        return self.err.strip().splitlines()

    @property
    def object(self) -> dict[str, Any]:
        """The JSON object on standard output, which must contain nothing else."""
        found = json.loads(self.out, parse_constant=_refused)
        assert isinstance(found, dict)
        return found


def _refused(text: str) -> None:
    raise ValueError(f"{text} is no JSON")


def refused(outcome: Outcome, *texts: str, status: int = 2) -> None:
    """Check that an outcome is a single error line that contains some texts."""
    assert outcome.status == status
    assert outcome.out == ""
    assert len(outcome.lines) == 1
    for text in ("bywire: error: ", *texts):
        assert text in outcome.err, outcome.err


def page_text(path: Path) -> str:
    """Return a report's HTML without the places at which long names may break."""
    return path.read_text(encoding="utf-8").replace("<wbr>", "")


def no_half_files(folder: Path) -> None:
    """Check that a folder contains no incomplete file."""
    assert not [path.name for path in folder.rglob("*") if path.name.startswith(".")]
