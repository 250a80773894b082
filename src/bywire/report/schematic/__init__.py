"""A model drawn as boxes and wires, from its own equations."""
