"""What methods of an assembly return by name: nothing unknown, and nothing left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.core.errors import ModelError, unknown_name


def known(
    model: Any, method: str, values: Mapping[str, Any], names: tuple[str, ...]
) -> dict[str, Any]:
    """Return what a method gives.

    Raises
    ------
    ModelError
        When it gives what is none of the names.
    """
    for name in values:
        if name not in names:
            raise ModelError(
                f"{type(model).__name__}.{method}: {unknown_name('signal', name, names)}"
            )
    return dict(values)


def filled(model: Any, method: str, kind: Any, values: Mapping[str, Any]) -> Any:
    """Return a signal tuple of what a method and the parts give.

    Raises
    ------
    ModelError
        When a field is given by neither.
    """
    for name in kind._fields:
        if name not in values:
            raise ModelError(
                f"{type(model).__name__}.{method} does not return {name!r}, and no part gives it: "
                f"add it to what {method} returns"
            )
    return kind(**{name: values[name] for name in kind._fields})
