"""`python -m explore3d` is the command `explore3d`."""

from explore3d.cli import main

if __name__ == "__main__":
    main()
