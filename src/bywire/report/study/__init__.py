"""Figures of studies: how figures are spread, what drives them, how sure an estimate is."""
