"""What is typed: options, numbers, units, files."""
