"""Long work in pieces: its identity, its computation, and the store of finished pieces."""
