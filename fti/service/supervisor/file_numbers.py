"""The numbers of the raw files, as the recorders of a session report them to the supervisor."""

from __future__ import annotations

from fti.messages.control import FileNumber


class FileNumbers:
    """The numbers that the recorders have taken, and the numbers of the written files."""

    def __init__(self) -> None:
        self._taken: set[int] = set()
        self._confirmed: set[int] = set()

    def handle_report(self, report: FileNumber) -> None:
        """Handle a report of a recorder."""
        (self._confirmed if report.confirmed else self._taken).add(report.number)

    @property
    def next(self) -> int:
        """The first number that the next recorder may take."""
        return max(self._taken | self._confirmed, default=-1) + 1

    @property
    def skipped_numbers(self) -> list[int]:
        """Smaller numbers without a known written file."""
        return sorted(self._taken - self._confirmed)
