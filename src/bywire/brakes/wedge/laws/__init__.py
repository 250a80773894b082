"""Control laws that only this brake uses."""
