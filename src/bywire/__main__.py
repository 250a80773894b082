"""``python -m bywire``: the same as the command ``bywire``."""

from bywire.cli.main import process

process()
