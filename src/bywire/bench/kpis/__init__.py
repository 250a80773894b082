"""Key figures of recordings, one family per file: exact definitions, declared names and units."""
