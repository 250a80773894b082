"""Virtual tests: an assembly, its ECU, a stimulus and sensors make an experiment that is judged."""
