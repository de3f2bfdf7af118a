"""Where the command `jacokin` starts, and `python -m jacokin`."""

from __future__ import annotations

import signal


def main() -> None:
    """Run the command line.

    Until it is loaded and takes care of Ctrl-C itself, Ctrl-C ends the process at once, without a traceback.

    Raises:
        SystemExit: always; carries the exit code.
    """
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from jacokin.cli.main import main as run

    try:
        signal.signal(signal.SIGINT, interrupt)
        run()
    except KeyboardInterrupt:
        raise SystemExit(128 + signal.SIGINT) from None


if __name__ == "__main__":
    main()
