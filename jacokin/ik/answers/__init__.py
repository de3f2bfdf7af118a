"""From everything that reaches a target to the one configuration that is wanted, or why there is none."""
