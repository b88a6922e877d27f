"""The numbers of raw files over several recorders: none is used twice, none is missing without a word."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fti.messages.control import FileNumber
from fti.service.supervisor.session_storage import FileNumbers

report = FileNumber


def test_a_number_whose_file_never_came_is_given_up_and_not_used_again() -> None:
    """Killed while a medium opened the first file: it may still appear."""
    numbers = FileNumbers()
    assert (numbers.next, numbers.skipped_numbers) == (0, [])
    numbers.handle_report(report(0, False))
    assert (numbers.next, numbers.skipped_numbers) == (1, [0])
    numbers.handle_report(report(1, False))
    numbers.handle_report(report(1, True))
    assert (numbers.next, numbers.skipped_numbers) == (2, [0])


@given(st.lists(st.tuples(st.integers(0, 20), st.booleans())))
def test_every_number_below_the_next_is_written_given_up_or_never_taken(reports: list[tuple[int, bool]]) -> None:
    numbers = FileNumbers()
    for number, confirmed in reports:
        numbers.handle_report(report(number, confirmed))
    written = {number for number, confirmed in reports if confirmed}
    assert set(numbers.skipped_numbers) == {number for number, _ in reports} - written
    assert all(number < numbers.next for number, _ in reports)
