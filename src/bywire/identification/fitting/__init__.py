"""Parameters of any bench from measured records: what is asked for, the fit, what it is worth."""
