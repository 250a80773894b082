"""A bench's run as WebAssembly, from parameters to the recording, for any page or program."""
