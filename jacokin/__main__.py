"""`python -m jacokin` is the command `jacokin`."""

from jacokin.cli.main import main

if __name__ == "__main__":
    main()
