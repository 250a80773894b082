"""What a server says no with: a status and one message with what to do next."""

from __future__ import annotations


class RefusedError(Exception):
    """A request that is not answered as it wanted.

    Parameters
    ----------
    status
        Of HTTP.
    text
        What is wrong, and what to do.
    field
        Of the form, beside which it is shown; none where it is no field's.
    """

    def __init__(self, status: int, text: str, field: str = "") -> None:
        super().__init__(text)
        self.status, self.text, self.field = status, text, field
