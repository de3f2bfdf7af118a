"""`jacokin info` and `jacokin crosscheck`: what a robot is, and whether two descriptions agree."""
