"""Scenes: obstacles around the arm as one thing, from Python, from a file, or from a MuJoCo model."""
