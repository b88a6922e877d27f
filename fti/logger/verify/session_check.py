"""What the numbers, the ledgers and the notes of gaps of a session amount to: check by check, link by link."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from fti.logger.lock import is_being_written
from fti.logger.raw_log import TICK_TOPIC
from fti.logger.reading.file_numbers import absent_numbers
from fti.logger.reading.recording import Recording
from fti.logger.reading.text_format import clock_text, ranges_text
from fti.logger.verify.gap_check import GapNotes
from fti.logger.verify.ledger import SOCKET_QUEUE, Amount
from fti.logger.verify.ledger_check import LedgerCheck, RecorderRun
from fti.logger.verify.report import Check, CheckVerdict, LinkAccount, VerifyReport
from fti.logger.verify.sequence_check import TICK_HOLE_NS, SequenceCheck, SequenceRange

NOT_TRIGGERED = "not_triggered"
#: Received by a recorder that was killed before it could write.
NEVER_WRITTEN = "never_written"
#: Held to the end of a recorder in good order, because the medium took no more.
STORAGE = "storage"


def conclude(
    report: VerifyReport,
    recording: Recording,
    numbers: SequenceCheck,
    ledger: LedgerCheck,
    gaps: GapNotes,
    *,
    is_from_start: bool,
) -> None:
    """Add the checks of the session and the accounts of its links."""
    alone = not recording.path.is_dir()
    session = _SessionCheck(recording, numbers, ledger, gaps, is_from_start=is_from_start, alone=alone)
    checks = [session.splits()]
    if recording.frame_files:
        checks += [session.sequence(), session.stamps(), session.ticks()]
    if recording.raw_files:
        checks += [session.topic_account(), session.recorders(), session.gap_notes()]
    if checks[0].verdict is CheckVerdict.REFUTED and recording.other_folders:
        checks = [_soften_partial(check, recording.other_folders) for check in checks]
    report.checks += checks
    report.missing = session.missing
    report.accounts = session.accounts()


def _soften_partial(check: Check, other_folders: Sequence[Path]) -> Check:
    """A check of one part of a session, whose medium may have been changed: what is missing may lie at the others."""
    if check.verdict is not CheckVerdict.REFUTED:
        return check
    judged = Check(check.name, check.text)
    for verdict, text in check.lines:
        judged.add(CheckVerdict.LOSS if verdict is CheckVerdict.REFUTED else verdict, text)
    places = ", ".join(map(str, other_folders))
    judged.add(CheckVerdict.LOSS, f"this may be a part of the session only: more of it may lie in {places}; give all")
    return judged


def frames_are_separate(recording: Recording) -> bool:
    """Are frames of snapshots and the ledgers that tell of them not both here?"""
    return not recording.raw_files or (recording.is_snapshot_session and not recording.path.is_dir())


class _SessionCheck:
    """The checks.  alone : one file of a session, whose neighbours are not looked at."""

    def __init__(
        self,
        recording: Recording,
        numbers: SequenceCheck,
        ledger: LedgerCheck,
        gaps: GapNotes,
        *,
        is_from_start: bool,
        alone: bool,
    ) -> None:
        self._recording = recording
        self._numbers = numbers
        self._ledger = ledger
        self._gaps = gaps
        self._alone = alone
        ranges = numbers.coverage.ranges
        self._begin = 0 if is_from_start else ranges[0].first if ranges else 0
        self._end = max([ranges[-1].last + 1 if ranges else 0, *(run.end for run in ledger.runs)])
        self._frames_are_separate = frames_are_separate(recording)
        self._holes = {id(run): ledger.holes(run) for run in ledger.runs}
        self.missing = (
            0 if self._frames_are_separate else sum(h.count for h in numbers.coverage.holes(self._begin, self._end))
        )

    # ------------------------------------------------------------------------------------------------ splits, numbers

    def splits(self) -> Check:
        """Is every file there?"""
        recording = self._recording
        check = Check("splits", f"{len(recording.raw_files)} raw files, none is missing")
        if not recording.raw_files:
            check.text = "no raw file"
            whole = self._alone or recording.is_reprocessed or not (recording.derived_files or recording.snapshot_files)
            check.add(
                CheckVerdict.NOTE if whole else CheckVerdict.LOSS, "no raw file is here: what came in is not proved"
            )
        for kind in ("raw", "derived", "snapshot") if not self._alone else ():
            skipped_numbers, missing = absent_numbers(recording, kind)
            if missing:
                check.add(CheckVerdict.REFUTED, f"{kind} files {ranges_text(missing)} are missing")
            if skipped_numbers:
                numbers = ranges_text([(n, n) for n in skipped_numbers])
                check.add(CheckVerdict.NOTE, f"{kind} numbers {numbers} were given up: no file was opened in time")
        return check

    def sequence(self) -> Check:
        """Is every number there, once?"""
        numbers = self._numbers
        check = Check("sequence", f"numbers {self._begin} to {self._end - 1}, each once")
        if numbers.doubles:
            check.add(CheckVerdict.REFUTED, f"{numbers.doubles} numbers stand twice in a file")
        if numbers.repeated:
            check.add(
                CheckVerdict.NOTE, f"{numbers.repeated} numbers stand in two files, as where the medium was changed"
            )
        for topic in numbers.topics.values():
            if topic.unordered:
                check.add(CheckVerdict.REFUTED, f"{topic.name}: the numbers do not rise {topic.unordered} times")
        if self._frames_are_separate:
            check.text = f"{numbers.frames} numbers, each once"
            check.add(
                CheckVerdict.NOTE, "frames around triggers stand apart from the books: the folder proves both together"
            )
            return check
        self._judge_outside(check)
        for run in self._ledger.runs:
            self._judge_before(check, run)
            self._judge_after(check, run)
        return check

    def _judge_outside(self, check: Check) -> None:
        """Numbers that no ledger covers."""
        begin = self._ledger.runs[0].begin if self._ledger.runs else self._end
        holes = self._numbers.coverage.holes(self._begin, begin)
        if holes and self._ledger.runs and self._alone:
            check.add(CheckVerdict.NOTE, f"{_missing(holes)}; they may stand in the file before")
        elif holes:
            check.add(CheckVerdict.REFUTED, f"{_missing(holes)}; no ledger accounts for them")

    def _judge_before(self, check: Check, run: RecorderRun) -> None:
        """Numbers before the last ledger of a recorder: it must account for every one."""
        holes = self._holes[id(run)][0]
        count = sum(hole.count for hole in holes)
        known = sum(topic_account.missing.frames for topic_account in run.topics.values())
        if count != known or any(topic_account.refuted for topic_account in run.topics.values()):
            what = _missing(holes) if holes else "no number is missing"
            check.add(
                CheckVerdict.REFUTED, f"{what}; by the ledger of {clock_text(run.last.t_ns)} it should be {known}"
            )
        elif holes:
            told = sum(hole.count for hole in holes if self._gaps.explains(hole))
            by = f"the ledger accounts for all, notes of gaps for {told}"
            check.add(self._verdict(run), f"{_missing(holes)}; {by}")

    def _verdict(self, run: RecorderRun) -> CheckVerdict:
        """Frames for which no trigger came are no loss."""
        reasons = {reason for topic_account in run.topics.values() for reason in topic_account.entry.dropped}
        lost = reasons - {NOT_TRIGGERED, SOCKET_QUEUE} or any(
            topic_account.unwritten for topic_account in run.topics.values()
        )
        return CheckVerdict.LOSS if lost else CheckVerdict.NOTE

    def _judge_after(self, check: Check, run: RecorderRun) -> None:
        """Numbers after the last ledger of a recorder."""
        holes = self._holes[id(run)][1]
        if not holes:
            return
        if run.last.final:
            check.add(CheckVerdict.REFUTED, f"{_missing(holes)}; they came after the last word of their recorder")
        elif self._alone:
            check.add(CheckVerdict.NOTE, f"{_missing(holes)}; they may stand in the next file")
        else:
            check.add(CheckVerdict.LOSS, f"{_missing(holes)}; they were received and never written")

    # -------------------------------------------------------------------------------------------------- stamps, ticks

    def stamps(self) -> Check:
        """Does the time of every link run forward, and is it that of the arrival?"""
        check = Check("stamps", "the time of every link runs forward")
        for topic in self._numbers.topics.values():
            if topic.backwards:
                check.add(CheckVerdict.REFUTED, f"{topic.name}: the time goes back {topic.backwards} times")
        for account in self.accounts():
            if count := account.stamps_refused:
                late = f"{count} frames have the time of their reading: the kernel's timestamps were refused"
                check.add(CheckVerdict.LOSS, f"{account.topic}: {late}")
        return check

    def ticks(self) -> Check:
        """Was the recorder running all the time?"""
        topic = self._numbers.topics.get(TICK_TOPIC)
        count, gap = (topic.frames, topic.longest_gap_ns) if topic else (0, 0)
        check = Check("ticks", f"{count} ticks, the longest time between two is {gap / 1e6:.0f} ms")
        for begin, end in self._numbers.tick_holes:
            if end - begin > TICK_HOLE_NS:
                check.add(CheckVerdict.NOTE, f"none for {(end - begin) / 1e9:.2f} s from {clock_text(begin)} on")
        return check

    # ---------------------------------------------------------------------------------------------- ledger, recorders

    def topic_account(self) -> Check:
        """Does every ledger agree with the files?"""
        ledger = self._ledger
        check = Check("ledger", f"{ledger.notes} ledgers agree with what the files hold")
        for finding in ledger.findings:
            check.add(CheckVerdict.REFUTED, finding)
        if ledger.unreadable:
            check.add(CheckVerdict.REFUTED, f"{ledger.unreadable} ledgers cannot be read")
        if not ledger.notes:
            check.text = "there is none: what came in is not known"
            check.add(
                CheckVerdict.LOSS, "no ledger stands in these files: whether all that came in is here is not proved"
            )
        for account in self.accounts():
            for reason, amount in account.dropped.items():
                size = f" ({amount.bytes} bytes)" if amount.bytes else ""
                verdict = CheckVerdict.NOTE if reason == NOT_TRIGGERED else CheckVerdict.LOSS
                check.add(verdict, f"{account.topic}: {amount.frames} frames{size} were dropped: {reason}")
        return check

    def recorders(self) -> Check:
        """Did every recorder end in good order?"""
        runs = self._ledger.runs
        closed = ", ended in good order" if all(run.last.final for run in runs) else ""
        check = Check("recorders", f"{len(runs)}{closed}")
        for run, after in zip_longest(runs, runs[1:]):
            if not run.last.final:
                self._tell_end(check, run, after)
        return check

    def _tell_end(self, check: Check, run: RecorderRun, after: RecorderRun | None) -> None:
        """A recorder without a last word: what is known of its last moments, and what cannot be."""
        until = clock_text(run.last.t_ns)
        if after is None and self._alone:
            check.add(
                CheckVerdict.NOTE, f"its last ledger here is of {until}; it goes on in another file, or was killed"
            )
            return
        if after is None and self._recording.raw_files and is_being_written(self._recording.raw_files[-1]):
            check.add(CheckVerdict.LOSS, "the session is being recorded; what is held in buffers now is not known")
            return
        behind = max(run.end - run.last.next_seq, 0)
        holes = self._holes[id(run)][1]
        lost = sum(hole.count for hole in holes)
        shown = (
            f"{lost} of them are missing: received and never written{_time_range_text(holes)}"
            if lost
            else "none is missing"
        )
        text = f"recorder {run.recorder.pid} ended without a last word after its ledger of {until}; "
        text += f"it gave {behind} numbers more, {shown}"
        if after is None:
            text += "; whether it received more cannot be known"
        else:
            text += self._outage_text(after)
        check.add(CheckVerdict.LOSS, text)

    def _outage_text(self, after: RecorderRun) -> str:
        started = after.recorder.started_ns
        for begin, end in self._numbers.tick_holes:
            if begin <= after.first.t_ns and started <= end:
                return f"; nobody listened for {(end - begin) / 1e9:.2f} s"
        return ""

    def gap_notes(self) -> Check:
        """Do the notes of gaps fit the holes?"""
        gaps = self._gaps
        check = Check("gaps", f"{len(gaps.overflows)} notes of overflowed buffers fit what is missing")
        for gap in gaps.overflows:
            missing = sum(hole.count for hole in self._numbers.coverage.holes(gap.first, gap.last + 1))
            if missing < gap.frames:
                told = f"{gap.frames} frames were dropped in numbers {gap.first} to {gap.last}, {missing} are missing"
                check.add(CheckVerdict.REFUTED, f"{gap.link}: the note tells that {told}")
        if gaps.unreadable:
            check.add(CheckVerdict.REFUTED, f"{gaps.unreadable} notes of gaps cannot be read")
        for text in gaps.descriptions:
            check.add(CheckVerdict.NOTE, text)
        if gaps.omitted_notes:
            check.add(CheckVerdict.NOTE, f"and {gaps.omitted_notes} more")
        return check

    # --------------------------------------------------------------------------------------------------------- accounts

    def accounts(self) -> list[LinkAccount]:
        """In = recorded + dropped by reason, for every topic, over all recorders."""
        topics = {topic for run in self._ledger.runs for topic in run.topics} | self._numbers.topics.keys()
        return [self._account(topic) for topic in sorted(topics - {TICK_TOPIC})]

    def _account(self, topic: str) -> LinkAccount:
        proof = self._numbers.topics.get(topic)
        account = LinkAccount(topic, Amount(proof.frames, proof.bytes) if proof else Amount())
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


def _missing(holes: list[SequenceRange]) -> str:
    count = sum(hole.count for hole in holes)
    return f"{count} numbers are missing: {ranges_text([(hole.first, hole.last) for hole in holes])}{_time_range_text(holes)}"


def _time_range_text(holes: list[SequenceRange]) -> str:
    """The time in which they came."""
    begin, end = min(hole.first_ns for hole in holes), max(hole.last_ns for hole in holes)
    return f" ({clock_text(begin)} to {clock_text(end)})" if begin else ""
