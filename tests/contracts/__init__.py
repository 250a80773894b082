"""What every element, parameter set and model must keep: users of ``bywire.contracts``."""
