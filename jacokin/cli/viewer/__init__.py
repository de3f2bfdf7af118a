"""`jacokin view`."""
