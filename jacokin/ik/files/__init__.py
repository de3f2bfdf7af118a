"""Files of target poses and of answers."""
