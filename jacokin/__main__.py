"""`python -m jacokin` is the command `jacokin`."""

from jacokin.cli.entry import main

if __name__ == "__main__":
    main()
