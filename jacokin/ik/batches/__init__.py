"""Batches of any length: a file of targets in, a file of answers out; `solve_file` is the file to read first."""
