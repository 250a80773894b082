"""Command line: argument parsing, messages, exit statuses; everything else lies below."""
