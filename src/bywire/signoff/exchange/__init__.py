"""Requirements from the files of other tools, and results back into copies of these files."""
