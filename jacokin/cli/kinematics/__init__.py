"""`jacokin fk` and `jacokin jacobian`."""
