"""What leaves the bench: an ECU's C, functional mock-up units, WebAssembly."""
