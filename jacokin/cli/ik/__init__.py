"""`jacokin ik`: joint angles for one pose, every branch of it, or a file of poses."""
