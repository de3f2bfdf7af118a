"""`jacokin map` and `jacokin place`: where the arm reaches, and where to put its base."""
