"""Entry point of ``python -m bywire.cli``, which does the same as the command ``bywire``."""

from bywire.cli.main import process

process()
