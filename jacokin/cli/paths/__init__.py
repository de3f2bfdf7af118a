"""`jacokin track` and `jacokin plan`: a path of poses in, a joint trajectory out."""
