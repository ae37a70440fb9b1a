"""`python -m explore3d` is the command `explore3d`."""

import sys


def main() -> None:
    """The command line; Ctrl-C while it is still being loaded ends it without a traceback, too."""
    try:
        from explore3d.cli import main as command
    except KeyboardInterrupt:
        print("explore3d: interrupted (Ctrl-C) before anything began", file=sys.stderr)
        sys.exit(130)
    command()


if __name__ == "__main__":
    main()
