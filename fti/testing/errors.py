"""Why a test on the bench fails before any assertion of it."""

from __future__ import annotations


class BenchError(AssertionError):
    """A program of the bench did not start, ended early, or did not do what was waited for; the message says which."""


class UnitKilledWarning(UserWarning):
    """A program of the unit under test did not end when it was asked to, and was killed."""
