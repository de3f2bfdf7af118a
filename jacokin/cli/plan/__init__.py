"""`jacokin plan`: a joint trajectory planned over all branches."""
