"""The application: scenes, sessions, logs, analysis, reports, views, command line."""

__version__ = "0.1.0"
