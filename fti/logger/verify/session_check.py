"""Checks of a session from its sequence numbers, ledgers and notes of gaps, and the accounts of its links."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from fti.logger.lock import is_being_written
from fti.logger.reading.file_numbers import absent_numbers
from fti.logger.reading.number_ranges import SequenceRange
from fti.logger.reading.recording import Recording
from fti.logger.reading.text_format import clock_text, ranges_text
from fti.logger.verify.gap_check import GapNotes
from fti.logger.verify.ledger import SOCKET_QUEUE, Amount
from fti.logger.verify.ledger_check import LedgerCheck, RecorderRun
from fti.logger.verify.report import Check, CheckResult, LinkAccount, VerifyReport
from fti.logger.verify.sequence_check import TICK_HOLE_NS, SequenceCheck
from fti.messages.topics import TICK_TOPIC

NOT_TRIGGERED = "not_triggered"
#: Received by a recorder that was killed before it could write.
NEVER_WRITTEN = "never_written"
#: Held until the normal end of a recorder, because the medium accepted no more.
STORAGE = "storage"


def _soften_partial(check: Check, other_folders: Sequence[Path]) -> Check:
    """Reduce a failed check of one part of a session to a loss: the missing data may be in other folders."""
    if check.result is not CheckResult.REFUTED:
        return check
    softened = Check(check.name, check.text)
    for result, text in check.lines:
        softened.add(CheckResult.LOSS if result is CheckResult.REFUTED else result, text)
    folders = ", ".join(map(str, other_folders))
    text = f"this may be only a part of the session; more may be in {folders}; name all folders"
    softened.add(CheckResult.LOSS, text)
    return softened


def frames_are_separate(recording: Recording) -> bool:
    """Are the frames of snapshots and their ledgers in different files, of which only some are open?"""
    return not recording.raw_files or (recording.is_snapshot_session and not recording.path.is_dir())


class SessionCheck:
    """The checks of a session, or of one file without its neighbours."""

    def __init__(
        self,
        recording: Recording,
        numbers: SequenceCheck,
        ledger: LedgerCheck,
        gaps: GapNotes,
        *,
        is_from_start: bool,
    ) -> None:
        self._recording = recording
        self._numbers = numbers
        self._ledger = ledger
        self._gaps = gaps
        self._is_single_file = not recording.path.is_dir()
        ranges = numbers.coverage.ranges
        self._begin = 0 if is_from_start else ranges[0].first if ranges else 0
        self._end = max([ranges[-1].last + 1 if ranges else 0, *(run.end for run in ledger.runs)])
        self._frames_are_separate = frames_are_separate(recording)
        self._holes = {id(run): ledger.holes(run) for run in ledger.runs}
        self.missing = (
            0 if self._frames_are_separate else sum(h.count for h in numbers.coverage.holes(self._begin, self._end))
        )

    def conclude(self, report: VerifyReport) -> None:
        """Add the checks of the session and the accounts of its links."""
        checks = [self.splits()]
        if self._recording.frame_files:
            checks += [self.sequence(), self.stamps(), self.ticks()]
        if self._recording.raw_files:
            checks += [self.ledgers(), self.recorders(), self.gap_notes()]
        if checks[0].result is CheckResult.REFUTED and self._recording.other_folders:
            checks = [_soften_partial(check, self._recording.other_folders) for check in checks]
        report.checks += checks
        report.missing = self.missing
        report.accounts = self.accounts()

    # ------------------------------------------------------------------------------------------------ splits, numbers

    def splits(self) -> Check:
        """Is every file present?"""
        recording = self._recording
        check = Check("splits", f"{len(recording.raw_files)} raw files, none is missing")
        if not recording.raw_files:
            check.text = "no raw file"
            others = recording.derived_files or recording.snapshot_files
            whole = self._is_single_file or recording.is_reprocessed or not others
            check.add(
                CheckResult.NOTE if whole else CheckResult.LOSS, "no raw file: complete reception cannot be verified"
            )
        for kind in ("raw", "derived", "snapshot") if not self._is_single_file else ():
            skipped_numbers, missing = absent_numbers(recording, kind)
            if missing:
                check.add(CheckResult.REFUTED, f"{kind} files {ranges_text(missing)} are missing")
            if skipped_numbers:
                numbers = ranges_text([(n, n) for n in skipped_numbers])
                check.add(CheckResult.NOTE, f"{kind} numbers {numbers} were skipped: no file was opened in time")
        return check

    def sequence(self) -> Check:
        """Is every number present once?"""
        numbers = self._numbers
        check = Check("sequence", f"numbers {self._begin} to {self._end - 1}, each once")
        if numbers.doubles:
            check.add(CheckResult.REFUTED, f"{numbers.doubles} numbers occur twice in a file")
        if numbers.repeated:
            check.add(
                CheckResult.NOTE, f"{numbers.repeated} numbers occur in two files, as after a change of the medium"
            )
        for topic in numbers.topics.values():
            if topic.unordered:
                check.add(CheckResult.REFUTED, f"{topic.name}: the numbers do not increase {topic.unordered} times")
        if self._frames_are_separate:
            check.text = f"{numbers.frames} numbers, each once"
            check.add(CheckResult.NOTE, "the ledgers are in other files: verify the session folder to check both")
            return check
        self._check_uncovered(check)
        for run in self._ledger.runs:
            self._check_before_ledger(check, run)
            self._check_after_ledger(check, run)
        return check

    def _check_uncovered(self, check: Check) -> None:
        """Check numbers that no ledger covers."""
        begin = self._ledger.runs[0].begin if self._ledger.runs else self._end
        holes = self._numbers.coverage.holes(self._begin, begin)
        if holes and self._ledger.runs and self._is_single_file:
            check.add(CheckResult.NOTE, f"{_missing_text(holes)}; they may be in the previous file")
        elif holes:
            check.add(CheckResult.REFUTED, f"{_missing_text(holes)}; no ledger accounts for them")

    def _check_before_ledger(self, check: Check, run: RecorderRun) -> None:
        """Check numbers before the last ledger of a recorder, which must account for each."""
        holes = self._holes[id(run)][0]
        count = sum(hole.count for hole in holes)
        known = sum(topic_account.missing.frames for topic_account in run.topics.values())
        if count != known or any(topic_account.refuted for topic_account in run.topics.values()):
            missing_text = _missing_text(holes) if holes else "no number is missing"
            check.add(
                CheckResult.REFUTED, f"{missing_text}; the ledger of {clock_text(run.last.t_ns)} accounts for {known}"
            )
        elif holes:
            explained = sum(hole.count for hole in holes if self._gaps.explains(hole))
            explanation = f"the ledger accounts for all, notes of gaps for {explained}"
            check.add(self._result(run), f"{_missing_text(holes)}; {explanation}")

    def _result(self, run: RecorderRun) -> CheckResult:
        """Frames without a trigger are not a loss."""
        reasons = {reason for topic_account in run.topics.values() for reason in topic_account.entry.dropped}
        lost = reasons - {NOT_TRIGGERED, SOCKET_QUEUE} or any(
            topic_account.unwritten for topic_account in run.topics.values()
        )
        return CheckResult.LOSS if lost else CheckResult.NOTE

    def _check_after_ledger(self, check: Check, run: RecorderRun) -> None:
        """Check numbers after the last ledger of a recorder."""
        holes = self._holes[id(run)][1]
        if not holes:
            return
        if run.last.final:
            check.add(CheckResult.REFUTED, f"{_missing_text(holes)}; they follow the final ledger of their recorder")
        elif self._is_single_file:
            check.add(CheckResult.NOTE, f"{_missing_text(holes)}; they may be in the next file")
        else:
            check.add(CheckResult.LOSS, f"{_missing_text(holes)}; they were received and never written")

    # -------------------------------------------------------------------------------------------------- stamps, ticks

    def stamps(self) -> Check:
        """Do the times of every link increase, and are they times of arrival?"""
        check = Check("stamps", "the time of every link increases")
        for topic in self._numbers.topics.values():
            if topic.backwards:
                check.add(CheckResult.REFUTED, f"{topic.name}: the time goes back {topic.backwards} times")
        for account in self.accounts():
            if count := account.stamps_refused:
                text = f"{count} frames have the time at which they were read: the kernel's timestamps were refused"
                check.add(CheckResult.LOSS, f"{account.topic}: {text}")
        return check

    def ticks(self) -> Check:
        """Was the recorder running all the time?"""
        topic = self._numbers.topics.get(TICK_TOPIC)
        count, gap = (topic.frames, topic.longest_gap_ns) if topic else (0, 0)
        check = Check("ticks", f"{count} ticks, the longest time between two is {gap / 1e6:.0f} ms")
        for begin, end in self._numbers.tick_holes:
            if end - begin > TICK_HOLE_NS:
                check.add(CheckResult.NOTE, f"none for {(end - begin) / 1e9:.2f} s from {clock_text(begin)} on")
        return check

    # ---------------------------------------------------------------------------------------------- ledger, recorders

    def ledgers(self) -> Check:
        """Does every ledger agree with the files?"""
        ledger = self._ledger
        check = Check("ledger", f"{ledger.notes} ledgers agree with the contents of the files")
        for finding in ledger.findings:
            check.add(CheckResult.REFUTED, finding)
        if ledger.unreadable:
            check.add(CheckResult.REFUTED, f"{ledger.unreadable} ledgers cannot be read")
        if not ledger.notes:
            check.text = "none: reception cannot be verified"
            check.add(CheckResult.LOSS, "no ledger in these files: complete reception cannot be verified")
        for account in self.accounts():
            for reason, amount in account.dropped.items():
                size = f" ({amount.bytes} bytes)" if amount.bytes else ""
                result = CheckResult.NOTE if reason == NOT_TRIGGERED else CheckResult.LOSS
                check.add(result, f"{account.topic}: {amount.frames} frames{size} were dropped: {reason}")
        return check

    def recorders(self) -> Check:
        """Did every recorder end normally?"""
        runs = self._ledger.runs
        closed = ", ended normally" if all(run.last.final for run in runs) else ""
        check = Check("recorders", f"{len(runs)}{closed}")
        for run, after in zip_longest(runs, runs[1:]):
            if not run.last.final:
                self._report_end(check, run, after)
        return check

    def _report_end(self, check: Check, run: RecorderRun, after: RecorderRun | None) -> None:
        """Report a recorder without a final ledger."""
        until = clock_text(run.last.t_ns)
        if after is None and self._is_single_file:
            text = f"its last ledger in this file is of {until}; it continued in another file or was killed"
            check.add(CheckResult.NOTE, text)
            return
        if after is None and self._recording.raw_files and is_being_written(self._recording.raw_files[-1]):
            check.add(CheckResult.LOSS, "the session is being recorded; the content of its buffers is not known")
            return
        later_count = max(run.end - run.last.next_seq, 0)
        holes = self._holes[id(run)][1]
        lost = sum(hole.count for hole in holes)
        missing_text = (
            f"{lost} of them are missing: received and never written{_time_range_text(holes)}"
            if lost
            else "none is missing"
        )
        text = f"recorder {run.recorder.pid} ended without a final ledger after its ledger of {until}; "
        text += f"it assigned {later_count} more numbers, {missing_text}"
        if after is None:
            text += "; whether it received more is not known"
        else:
            text += self._outage_text(after)
        check.add(CheckResult.LOSS, text)

    def _outage_text(self, after: RecorderRun) -> str:
        started = after.recorder.started_ns
        for begin, end in self._numbers.tick_holes:
            if begin <= after.first.t_ns and started <= end:
                return f"; no recorder ran for {(end - begin) / 1e9:.2f} s"
        return ""

    def gap_notes(self) -> Check:
        """Do the notes of gaps match the holes?"""
        gaps = self._gaps
        check = Check("gaps", f"{len(gaps.overflows)} notes of overflowed buffers match the missing numbers")
        for gap in gaps.overflows:
            missing = sum(hole.count for hole in self._numbers.coverage.holes(gap.first, gap.last + 1))
            if missing < gap.frames:
                text = f"{gap.frames} frames were dropped in numbers {gap.first} to {gap.last}, {missing} are missing"
                check.add(CheckResult.REFUTED, f"{gap.link}: the note states that {text}")
        if gaps.unreadable:
            check.add(CheckResult.REFUTED, f"{gaps.unreadable} notes of gaps cannot be read")
        for text in gaps.descriptions:
            check.add(CheckResult.NOTE, text)
        if gaps.omitted_notes:
            check.add(CheckResult.NOTE, f"and {gaps.omitted_notes} more")
        return check

    # --------------------------------------------------------------------------------------------------------- accounts

    def accounts(self) -> list[LinkAccount]:
        """In = recorded + dropped by reason, for every topic, over all recorders."""
        topics = {topic for run in self._ledger.runs for topic in run.topics} | self._numbers.topics.keys()
        return [self._account(topic) for topic in sorted(topics - {TICK_TOPIC})]

    def _account(self, topic: str) -> LinkAccount:
        sequence = self._numbers.topics.get(topic)
        account = LinkAccount(topic, Amount(sequence.frames, sequence.bytes) if sequence else Amount())
        for run in self._ledger.runs:
            topic_account = run.topics.get(topic)
            if topic_account is None:
                continue
            base = topic_account.base.dropped if topic_account.base else {}
            for reason, amount in topic_account.entry.dropped.items():
                _add(account.dropped, reason, amount.minus(base.get(reason, Amount())))
            unwritten = topic_account.missing.minus(topic_account.dropped)
            _add(account.dropped, STORAGE if run.last.final else NEVER_WRITTEN, unwritten)
            for name, count in topic_account.entry.errors.items():
                account.errors[name] = account.errors.get(name, 0) + count
            account.stamps_refused += topic_account.entry.stamps_refused - (
                topic_account.base.stamps_refused if topic_account.base else 0
            )
        return account


def _add(dropped: dict[str, Amount], reason: str, amount: Amount) -> None:
    if amount.frames > 0:
        dropped[reason] = dropped.get(reason, Amount()).plus(amount)


def _missing_text(holes: list[SequenceRange]) -> str:
    count = sum(hole.count for hole in holes)
    ranges = ranges_text([(hole.first, hole.last) for hole in holes])
    return f"{count} numbers are missing: {ranges}{_time_range_text(holes)}"


def _time_range_text(holes: list[SequenceRange]) -> str:
    """The time range of the holes."""
    begin, end = min(hole.first_ns for hole in holes), max(hole.last_ns for hole in holes)
    return f" ({clock_text(begin)} to {clock_text(end)})" if begin else ""
