"""What every element, law, parameter set and model must keep, whoever wrote it."""
