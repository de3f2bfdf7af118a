"""The target and the answer of a view as text to paste: Python, and a command line."""
