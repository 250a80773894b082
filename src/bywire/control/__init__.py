"""Control laws, one per file: sampled, pure, written against the values the ECU believes."""
