"""Virtual tests: assembly, ECU, stimulus and sensors make an experiment, whose recording is judged."""
