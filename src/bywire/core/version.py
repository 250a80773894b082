"""The version of the package; every recording and report names it."""

__version__ = "0.1.0"
