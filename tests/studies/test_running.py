"""Studies run: what goes on beside their chunks."""

from __future__ import annotations

import sys
from multiprocessing import active_children

import pytest

from bywire.core.typing import silent
from bywire.studies.running import complete
from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study


# A process of tests has threads; commands that are copied have none.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_what_waits_for_chunks_is_used_meanwhile(study, tmp_path, monkeypatch):
    if sys.platform != "linux":
        pytest.skip("processes are copied on Linux alone")
    monkeypatch.setattr("bywire.studies.executor.may_copy", lambda: True)
    plan, store = read_study(study()), StudyStore(tmp_path / "out")
    seen: list[int] = []
    complete(
        plan,
        store,
        Origin(tmp_path / "study.toml"),
        workers=2,
        progress=silent,
        meanwhile=lambda: seen.append(len(active_children())),
    )
    assert seen == [2]
    assert len(store.finished()) == plan.chunks
