"""The registry loads only files that are named after a thing or quote it."""

import subprocess
import sys

import pytest

FIND = """
import sys
from bywire.bench.experiment import EXPERIMENTS
EXPERIMENTS.find({name!r})
print(*sorted(m.rpartition(".")[2] for m in sys.modules if ".wedge.experiments." in m))
"""


@pytest.mark.parametrize(
    ("name", "files"),
    [("disc-stop", "disc_stop"), ("corner-panic", "corner_stop"), ("moment-ramp", "moment_tests")],
)
def test_the_other_files_of_a_folder_are_not_loaded(name, files):
    code = [sys.executable, "-c", FIND.format(name=name)]
    done = subprocess.run(code, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [files]
