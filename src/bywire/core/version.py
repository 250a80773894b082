"""Version of the package, which every recording and report contains."""

__version__ = "0.1.0"
