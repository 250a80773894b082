"""Linear models, frequency responses, margins, hysteresis: what recordings and models tell."""
