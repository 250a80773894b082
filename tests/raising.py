"""Assert what an error is about by its fields, whatever its wording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from bywire.core.errors import BywireError


@contextmanager
def raises(
    kind: type[BywireError], *, name: str = "", value: str = "", valid: str = ""
) -> Iterator[pytest.ExceptionInfo[BywireError]]:
    """Expect an error whose fields hold these texts; each is also part of what the user reads."""
    with pytest.raises(kind) as caught:
        yield caught
    error = caught.value
    expected = {"name": name, "value": value, "valid": valid}
    found = {field: getattr(error, field) for field in expected}
    for field, text in expected.items():
        assert text in found[field], f"{field} of {found}: {error}"
        assert text in str(error), str(error)
