"""Elements that only this brake uses."""
