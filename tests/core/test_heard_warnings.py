"""Commands show warnings that a user can act on, but none for developers of libraries."""

from __future__ import annotations

import subprocess
import sys

import pytest

LINES = """
import warnings
from bywire.core.callers import collected_warnings
with collected_warnings() as heard:
    for _ in range(2):
        warnings.warn("the step is coarse")
    warnings.warn("use reshape", DeprecationWarning)
    open("/dev/null")
print(*[str(each.message) for each in heard], sep="; ")
"""


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ((), "the step is coarse; the step is coarse"),
        (("-W", "default"), "the step is coarse; the step is coarse; use reshape; unclosed file"),
    ],
)
def test_what_python_hides_is_not_told_unless_it_was_asked_for(options, told):
    done = subprocess.run(
        [sys.executable, *options, "-c", LINES], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith(told)
    assert options or done.stdout == f"{told}\n"
