"""Control laws, one per file: sampled pure functions that use the values that the ECU assumes."""
