"""How fast bywire is, against hand-written C and against what users would pick instead."""
