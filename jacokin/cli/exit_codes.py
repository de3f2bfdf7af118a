"""Exit codes of the commands; 0 means solved, or that the check passed."""

NOT_SOLVED = 1  # not (all) solved, or a check failed
WRONG_INPUT = 2  # wrong usage or input
INTERRUPTED = 130  # Ctrl-C
