"""`python -m jacokin` is the command `jacokin`."""

from __future__ import annotations

from jacokin.cli.entry import main

if __name__ == "__main__":
    main()
