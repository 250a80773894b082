"""Reader of the evidence of each kind, by its key in a sign-off file."""

from __future__ import annotations

from functools import partial

from bywire.signoff.signoff_file import Readers
from bywire.usecases.evidence.kinds import KINDS, read_kind
from bywire.usecases.evidence.manual import read_manual
from bywire.usecases.evidence.study import read_study_task

READERS: Readers = {
    **{kind: partial(read_kind, kind) for kind in KINDS},
    "study": read_study_task,
    "manual": read_manual,
}
