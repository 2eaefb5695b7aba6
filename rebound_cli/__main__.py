import sys

from rebound_cli.exit_codes import INTERRUPTED


def run() -> int:
    """The command line, from the first import on."""
    try:
        from rebound_cli.main import main

        return main()
    except KeyboardInterrupt:
        # What is still being loaded flies nothing.
        print("rebound: ended at once.", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(run())
