"""Virtual tests: an experiment runs an assembly with ECU, stimulus and sensors, and judges it."""
