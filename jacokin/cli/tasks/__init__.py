"""`jacokin task`: run a task, record it, show it."""
