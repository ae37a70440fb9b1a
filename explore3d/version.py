"""The version of the program, in a file that imports nothing: pyproject.toml reads it, and so does all of explore3d."""

__version__ = "0.2.0"
