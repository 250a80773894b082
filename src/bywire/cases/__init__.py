"""Long work in pieces: identity, computation, and store of finished pieces."""
