"""What a page asks to be computed, one task a file: fields, and the public function they go to."""
