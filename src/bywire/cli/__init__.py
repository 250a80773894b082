"""Command line: argument parsing, messages, exit statuses; lower layers do everything else."""
