"""`jacokin track`: a joint trajectory along a path of poses."""
