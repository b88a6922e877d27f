"""What goes from a buffer into which file."""

from __future__ import annotations

import pytest

from fti.buffers.triple_buffer import TripleBuffer
from fti.frame_batch import iter_frames
from fti.service.recorder.log_source import LogSource


class Rig:
    """A source and what it has recorded."""

    def __init__(self) -> None:
        self.buffer = TripleBuffer()
        self.source = LogSource("a", 1, self.buffer)

    def carry(self, *numbers: int) -> list[int]:
        """Put frames into the buffer and record what there is; returns what was recorded now."""
        for number in numbers:
            self.buffer.put(number, number, b"x")
        bursts = self.source.pending()
        self.source.mark_recorded(bursts)
        return [entry[0] for entry in iter_frames(bursts)]


@pytest.mark.parametrize(("is_uncertain", "again"), [(True, [0, 1, 2, 3]), (False, [2, 3])])
def test_what_a_lost_medium_may_not_have_is_recorded_again(is_uncertain: bool, again: list[int]) -> None:
    rig = Rig()
    assert rig.carry(0, 1) == [0, 1]
    rig.source.mark_written()
    assert rig.carry(2) == [2]
    rig.source.restart(is_uncertain=is_uncertain)
    assert rig.carry(3) == again
    rig.source.restart(is_uncertain=True)
    assert rig.carry() == again
    rig.source.mark_written()
    assert rig.buffer.stats.frames_out == 4


def test_what_is_synced_is_not_recorded_again() -> None:
    rig = Rig()
    rig.carry(0, 1)
    rig.source.mark_written()
    rig.source.mark_synced()
    rig.source.restart(is_uncertain=True)
    assert rig.carry(2) == [2]
