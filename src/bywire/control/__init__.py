"""Control laws, one per file: sampled, pure, and based on the values that the ECU assumes."""
