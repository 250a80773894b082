"""A bench's run as WebAssembly: parameters in, recording out, in any page or program."""
