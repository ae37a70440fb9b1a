"""Errors of the planners package."""


class PlannerError(ValueError):
    """A planner's setting that cannot work, or a move that breaks a limit; says what is possible."""
