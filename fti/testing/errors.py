"""Errors of a bench, before any assertion of a test."""

from __future__ import annotations


class BenchError(AssertionError):
    """A program of the bench did not start, ended early, or a wait timed out; the message names it."""


class UnitKilledWarning(UserWarning):
    """A program of the unit under test did not end after its signal, and was killed."""
