"""Check of the ledgers against the frames in the files: in = recorded + dropped.

Every ledger states how many numbers had been assigned.  The number of frames of a link with smaller numbers must be the
number received less the number dropped; at most the frames held in buffers at that time may be missing.  Each ledger of
a recorder is compared; the accounts of several recorders are added.

A killed recorder has no final ledger.  The next one continues after the last assigned number.  Missing smaller numbers
were received and never written.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import zip_longest

from fti.logger.reading.number_ranges import SequenceRange
from fti.logger.reading.text_format import clock_text
from fti.logger.verify.ledger import NOTHING, Amount, LedgerEntry, LedgerNote, LedgerReader, RecorderIdentity
from fti.logger.verify.sequence_check import SequenceCheck
from fti.messages.topics import TICK_TOPIC

_ZERO = LedgerEntry()


@dataclass(slots=True)
class TopicAccount:
    """The account of one topic in one run.

    base  : entry of the first ledger compared; base_found : frames found up to it
    entry : entry of the last one; missing : frames received up to it that are not in the files
    """

    base: LedgerEntry | None = None
    base_found: Amount = NOTHING
    entry: LedgerEntry = _ZERO
    found: Amount = NOTHING
    missing: Amount = NOTHING
    refuted: bool = False

    @property
    def dropped(self) -> Amount:
        """Dropped numbered frames according to the ledgers."""
        return self.entry.lost.minus((self.base or _ZERO).lost)

    @property
    def unwritten(self) -> int:
        """Frames that were held in a buffer and never written."""
        return max(self.missing.frames - self.dropped.frames, 0)


@dataclass(slots=True)
class RecorderRun:
    """One recorder.  begin, end : of its numbers; whole : from its first number on."""

    recorder: RecorderIdentity
    first: LedgerNote
    last: LedgerNote
    whole: bool
    topics: dict[str, TopicAccount] = field(default_factory=dict)
    end: int = 0

    @property
    def begin(self) -> int:
        """The first number that its ledgers account for."""
        return self.recorder.first_seq if self.whole else self.first.next_seq


@dataclass(slots=True)
class _Mark:
    """Entry of a ledger: an account of a topic up to a number."""

    run: RecorderRun
    number: int
    t_ns: int
    entry: LedgerEntry


class LedgerCheck:
    """Compares the ledgers with the frames in the files.  findings : mismatches.

    is_from_start       : the files hold the session from its first number on
    frames_are_separate : the frames of the links are in other files: only the ticks can be compared
    """

    def __init__(self, numbers: SequenceCheck, *, is_from_start: bool, frames_are_separate: bool = False) -> None:
        self.findings: list[str] = []
        self.runs: list[RecorderRun] = []
        self.notes = 0
        self.unreadable = 0
        self._numbers = numbers
        self._reader = LedgerReader()
        self._is_from_start = is_from_start
        self._frames_are_separate = frames_are_separate
        self._marks: dict[str, deque[_Mark]] = {}
        self._digests: set[int] = set()

    def feed(self, log_time: int, data: bytes) -> None:
        """Add a ledger from a file."""
        try:
            note = self._reader.read(log_time, data)
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError):
            self.unreadable += 1
            return
        if note.digest in self._digests:  # after a change of the medium, both may hold it
            return
        self._digests.add(note.digest)
        self.notes += 1
        where = f"the ledger of {clock_text(log_time)}"
        if note.t_ns != log_time:
            self.findings.append(f"{where} states the time {clock_text(note.t_ns)}")
        self.findings += (f"{where}: {fault}" for fault in note.faults())
        self._enter(note, where)

    def _enter(self, note: LedgerNote, where: str) -> None:
        run = self.runs[-1] if self.runs else None
        if run is None or run.recorder != note.recorder:
            run = self._begin(note, where)
        elif note.falls_behind(run.last):
            self.findings.append(f"{where} counts less than an earlier one")
        elif run.last.final:
            self.findings.append(f"{where} comes after the recorder's final ledger")
        run.last = note
        for topic, entry in note.entries.items():
            self._mark(topic, _Mark(run, note.next_seq, note.t_ns, entry))

    def _begin(self, note: LedgerNote, where: str) -> RecorderRun:
        before = self.runs[-1] if self.runs else None
        if before and note.recorder.first_seq < max(before.last.next_seq, before.recorder.first_seq + 1):
            self.findings.append(f"{where}: two recorders assigned the number {note.recorder.first_seq}")
        run = RecorderRun(note.recorder, note, note, whole=self._is_from_start or before is not None)
        self.runs.append(run)
        if run.whole:
            for topic in note.entries:
                self._mark(topic, _Mark(run, note.recorder.first_seq, note.recorder.started_ns, _ZERO))
        return run

    def _mark(self, topic: str, mark: _Mark) -> None:
        """Queue an entry; of equal entries of a silent topic only the first and the last one are kept."""
        if self._frames_are_separate and topic != TICK_TOPIC:
            return
        marks = self._marks.setdefault(topic, deque())
        if len(marks) > 1 and all(m.run is mark.run and m.entry == mark.entry for m in (marks[-1], marks[-2])):
            marks.pop()
        marks.append(mark)

    # ---------------------------------------------------------------------------------------------------- comparing

    def settle(self) -> None:
        """Compare topics whose frames before a ledger have all been read: their numbers increase."""
        for topic, marks in self._marks.items():
            sequence = self._numbers.topics.get(topic)
            while marks and sequence and sequence.last_seq >= marks[0].number:
                self._compare(topic, marks.popleft())

    def finish(self) -> None:
        """Compare the rest after everything has been read."""
        for topic, marks in self._marks.items():
            while marks:
                self._compare(topic, marks.popleft())
        ranges = self._numbers.coverage.ranges
        files_end = ranges[-1].last + 1 if ranges else 0
        for run, after in zip_longest(self.runs, self.runs[1:]):
            run.end = after.recorder.first_seq if after else max(files_end, run.last.next_seq)
        for topic in sorted(self._numbers.topics.keys() - set(self._marks)) if self.runs else ():
            self.findings.append(f"{topic}: has frames but is in no ledger")
        self._check_errors()

    def _compare(self, topic: str, mark: _Mark) -> None:
        sequence = self._numbers.topics.get(topic)
        counted = sequence.count_below(mark.number) if sequence else (0, 0)
        topic_account = mark.run.topics.setdefault(topic, TopicAccount())
        if counted is None or topic_account.refuted:
            return
        found = Amount(*counted)
        if topic_account.base is None:
            topic_account.base, topic_account.base_found = mark.entry, found
        topic_account.entry, topic_account.found = mark.entry, found.minus(topic_account.base_found)
        topic_account.missing = mark.entry.numbered.minus(topic_account.base.numbered).minus(topic_account.found)
        self._check_bounds(topic, mark, topic_account)

    def _check_bounds(self, topic: str, mark: _Mark, topic_account: TopicAccount) -> None:
        """Missing frames must be the dropped ones, within the frames held now or at the base."""
        held_before = topic_account.base.held if topic_account.base else NOTHING
        parts = zip(
            ("frames", "bytes"), topic_account.missing, topic_account.dropped, mark.entry.held, held_before, strict=True
        )
        for what, missing, dropped, held, before in parts:
            if not dropped - before <= missing <= dropped + held:
                topic_account.refuted = True
                held_text = f", {held} were held" if held else ""
                self.findings.append(
                    f"{topic}: of the {what} before the ledger of {clock_text(mark.t_ns)}, {missing} are not in the "
                    f"files; it states {dropped} dropped{held_text}"
                )
                return

    def _check_errors(self) -> None:
        """Compare the number of recorded error frames of a CAN bus."""
        for topic, sequence in self._numbers.topics.items():
            runs = [run.topics[topic] for run in self.runs if topic in run.topics]
            ledger_count = sum(topic_account.entry.errors.get("can_error_frames", 0) for topic_account in runs)
            closed = all(run.whole and run.last.final for run in self.runs)
            whole = closed and not any(topic_account.missing.frames for topic_account in runs)
            if runs and sequence.is_can and whole and ledger_count != sequence.error_frames:
                self.findings.append(f"{topic}: {sequence.error_frames} error frames, the ledger states {ledger_count}")

    # ------------------------------------------------------------------------------------------------- what is missing

    def holes(self, run: RecorderRun) -> tuple[list[SequenceRange], list[SequenceRange]]:
        """The missing numbers of a run: before its last ledger, and after it."""
        coverage, last = self._numbers.coverage, run.last.next_seq
        return coverage.holes(run.begin, min(last, run.end)), coverage.holes(max(last, run.begin), run.end)
