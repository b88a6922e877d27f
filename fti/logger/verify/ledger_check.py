"""The ledger under proof: in = recorded + dropped, made again from the frames in the files.

Every ledger tells how many numbers had been given when it was made.  So the frames of a link with smaller numbers must
be as many as came in, less what was dropped; no more may be missing than were held in the buffers at that moment.  The
books of a recorder are compared at each of its ledgers, and those of several recorders are added.

A recorder that was killed has no last word.  The next one goes on behind the last number that was given, so what is
missing before that number was received and never written.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import zip_longest

from fti.logger.raw_log import TICK_TOPIC
from fti.logger.reading.text_format import clock_text
from fti.logger.verify.ledger import NOTHING, Amount, LedgerEntry, LedgerNote, LedgerReader, RecorderIdentity
from fti.logger.verify.sequence_check import SequenceCheck, SequenceRange

_ZERO = LedgerEntry()


@dataclass(slots=True)
class TopicAccount:
    """The account of one topic in one run.

    base  : what the first of the ledgers that are compared says, and what had been found then
    entry : what the last one says; missing : what is not in the files of what had come in then
    """

    base: LedgerEntry | None = None
    base_found: Amount = NOTHING
    entry: LedgerEntry = _ZERO
    found: Amount = NOTHING
    missing: Amount = NOTHING
    refuted: bool = False

    @property
    def dropped(self) -> Amount:
        """What the ledgers tell of drops of numbered frames."""
        return self.entry.lost.minus((self.base or _ZERO).lost)

    @property
    def unwritten(self) -> int:
        """Frames that were held in a buffer and came into no file."""
        return max(self.missing.frames - self.dropped.frames, 0)


@dataclass(slots=True)
class RecorderRun:
    """One recorder.  begin, end : the numbers that are its own; whole : from its first number on."""

    recorder: RecorderIdentity
    first: LedgerNote
    last: LedgerNote
    whole: bool
    topics: dict[str, TopicAccount] = field(default_factory=dict)
    end: int = 0

    @property
    def begin(self) -> int:
        """The first number that its books can account for."""
        return self.recorder.first_seq if self.whole else self.first.next_seq


@dataclass(slots=True)
class _Mark:
    """Up to this number, an account says what came in."""

    run: RecorderRun
    number: int
    t_ns: int
    entry: LedgerEntry


class LedgerCheck:
    """Compares the ledgers with what was found.  findings : what does not hold.

    begins : the files hold the session from its first number on
    apart  : the frames of the links stand in other files: only the ticks can be compared
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
        self._seen: set[int] = set()

    def feed(self, log_time: int, data: bytes) -> None:
        """A ledger from a file."""
        try:
            note = self._reader.read(log_time, data)
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError):
            self.unreadable += 1
            return
        if note.digest in self._seen:  # where the medium was changed, it may stand on both
            return
        self._seen.add(note.digest)
        self.notes += 1
        where = f"the ledger of {clock_text(log_time)}"
        if note.t_ns != log_time:
            self.findings.append(f"{where} says that it is of {clock_text(note.t_ns)}")
        self.findings += (f"{where}: {fault}" for fault in note.faults())
        self._enter(note, where)

    def _enter(self, note: LedgerNote, where: str) -> None:
        run = self.runs[-1] if self.runs else None
        if run is None or run.recorder != note.recorder:
            run = self._begin(note, where)
        elif note.falls_behind(run.last):
            self.findings.append(f"{where} tells of less than one before it")
        elif run.last.final:
            self.findings.append(f"{where} comes after the recorder's last word")
        run.last = note
        for topic, entry in note.entries.items():
            self._mark(topic, _Mark(run, note.next_seq, note.t_ns, entry))

    def _begin(self, note: LedgerNote, where: str) -> RecorderRun:
        before = self.runs[-1] if self.runs else None
        if before and note.recorder.first_seq < max(before.last.next_seq, before.recorder.first_seq + 1):
            self.findings.append(f"{where}: two recorders gave the number {note.recorder.first_seq}")
        run = RecorderRun(note.recorder, note, note, whole=self._is_from_start or before is not None)
        self.runs.append(run)
        if run.whole:
            for topic in note.entries:
                self._mark(topic, _Mark(run, note.recorder.first_seq, note.recorder.started_ns, _ZERO))
        return run

    def _mark(self, topic: str, mark: _Mark) -> None:
        """Of ledgers that tell the same of a silent topic, the first and the last one wait: the others add nothing."""
        if self._frames_are_separate and topic != TICK_TOPIC:
            return
        marks = self._marks.setdefault(topic, deque())
        if len(marks) > 1 and all(m.run is mark.run and m.entry == mark.entry for m in (marks[-1], marks[-2])):
            marks.pop()
        marks.append(mark)

    # ---------------------------------------------------------------------------------------------------- comparing

    def settle(self) -> None:
        """Compare where all frames before a ledger have been seen: the numbers of a topic rise."""
        for topic, marks in self._marks.items():
            proof = self._numbers.topics.get(topic)
            while marks and proof and proof.last_seq >= marks[0].number:
                self._compare(topic, marks.popleft())

    def finish(self) -> None:
        """Everything has been read."""
        for topic, marks in self._marks.items():
            while marks:
                self._compare(topic, marks.popleft())
        ranges = self._numbers.coverage.ranges
        behind = ranges[-1].last + 1 if ranges else 0
        for run, after in zip_longest(self.runs, self.runs[1:]):
            run.end = after.recorder.first_seq if after else max(behind, run.last.next_seq)
        self._check_unknown()
        self._check_errors()

    def _compare(self, topic: str, mark: _Mark) -> None:
        proof = self._numbers.topics.get(topic)
        below = proof.below(mark.number) if proof else (0, 0)
        topic_account = mark.run.topics.setdefault(topic, TopicAccount())
        if below is None or topic_account.refuted:
            return
        found = Amount(*below)
        if topic_account.base is None:
            topic_account.base, topic_account.base_found = mark.entry, found
        topic_account.entry, topic_account.found = mark.entry, found.minus(topic_account.base_found)
        topic_account.missing = mark.entry.numbered.minus(topic_account.base.numbered).minus(topic_account.found)
        self._judge(topic, mark, topic_account)

    def _judge(self, topic: str, mark: _Mark, topic_account: TopicAccount) -> None:
        """Missing is what was dropped; and, of what is held now or was held at the base, perhaps some more or less."""
        held_before = topic_account.base.held if topic_account.base else NOTHING
        parts = zip(
            ("frames", "bytes"), topic_account.missing, topic_account.dropped, mark.entry.held, held_before, strict=True
        )
        for what, missing, dropped, held, before in parts:
            if not dropped - before <= missing <= dropped + held:
                topic_account.refuted = True
                kept = f", {held} were held" if held else ""
                self.findings.append(
                    f"{topic}: of the {what} before the ledger of {clock_text(mark.t_ns)}, {missing} are not in the "
                    f"files; it tells of {dropped} that were dropped{kept}"
                )
                return

    def _check_unknown(self) -> None:
        known = set(self._marks)
        for topic in sorted(self._numbers.topics.keys() - known) if self.runs else ():
            self.findings.append(f"{topic}: has frames and stands in no ledger")

    def _check_errors(self) -> None:
        """Error frames of a CAN bus are recorded, so their number can be made again."""
        for topic, proof in self._numbers.topics.items():
            runs = [run.topics[topic] for run in self.runs if topic in run.topics]
            told = sum(topic_account.entry.errors.get("can_error_frames", 0) for topic_account in runs)
            closed = all(run.whole and run.last.final for run in self.runs)
            whole = closed and not any(topic_account.missing.frames for topic_account in runs)
            if runs and proof.is_can and whole and told != proof.error_frames:
                self.findings.append(f"{topic}: {proof.error_frames} error frames, the ledger tells of {told}")

    # ------------------------------------------------------------------------------------------------- what is missing

    def holes(self, run: RecorderRun) -> tuple[list[SequenceRange], list[SequenceRange]]:
        """The missing numbers of a run: before its last ledger, and after it."""
        coverage, last = self._numbers.coverage, run.last.next_seq
        return coverage.holes(run.begin, min(last, run.end)), coverage.holes(max(last, run.begin), run.end)
