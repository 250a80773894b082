"""The folder of a study: what was written is judged as it is read."""

from __future__ import annotations

import numpy as np
import pandas as pd

from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study


def test_texts_are_the_same_from_files(study, tmp_path):
    """What was written is not read again: texts of a fixed width are objects in either case."""
    plan = read_study(study())
    kept = StudyStore(tmp_path)
    kept.open(plan, Origin(tmp_path / "study.toml"))
    kept.write(0, {"law": np.array(["paper", "none"]), "x": np.array([1, 2])}, {})
    pd.testing.assert_frame_equal(kept.read(1), StudyStore(tmp_path).read(1), check_exact=True)
    one, other = (store.columns(0)["law"] for store in (kept, StudyStore(tmp_path)))
    assert one.dtype == other.dtype == object
    kept.path(0).write_bytes(b"")
    assert kept.columns(0)["law"] is one
