"""How fast bywire is, against hand-written C and against other simulators."""
