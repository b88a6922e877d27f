"""What the numbers, the ledgers and the notes of gaps of a session amount to: check by check, link by link."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from fti.logger.lock import is_being_written
from fti.logger.proof.balance import LedgerProof, Run
from fti.logger.proof.gaps import Gaps
from fti.logger.proof.ledger import SOCKET_QUEUE, Amount
from fti.logger.proof.numbers import TICK_HOLE_NS, NumberProof, Span
from fti.logger.proof.report import Account, Check, Report, Verdict
from fti.logger.raw_log import TICK_TOPIC
from fti.logger.reading.file_numbers import absent_numbers
from fti.logger.reading.recording import Recording
from fti.logger.reading.wording import clock_text, ranges_text

NOT_TRIGGERED = "not_triggered"
#: Received by a recorder that was killed before it could write.
NEVER_WRITTEN = "never_written"
#: Held to the end of a recorder in good order, because the medium took no more.
STORAGE = "storage"


def conclude(
    report: Report, recording: Recording, numbers: NumberProof, ledger: LedgerProof, gaps: Gaps, *, begins: bool
) -> None:
    """Add the checks of the session and the accounts of its links."""
    alone = not recording.path.is_dir()
    session = _Session(recording, numbers, ledger, gaps, begins=begins, alone=alone)
    checks = [session.splits()]
    if recording.frame_files:
        checks += [session.sequence(), session.stamps(), session.ticks()]
    if recording.raw_files:
        checks += [session.books(), session.recorders(), session.gap_notes()]
    if checks[0].verdict is Verdict.REFUTED and recording.elsewhere:
        checks = [_of_a_part(check, recording.elsewhere) for check in checks]
    report.checks += checks
    report.missing = session.missing
    report.accounts = session.accounts()


def _of_a_part(check: Check, elsewhere: Sequence[Path]) -> Check:
    """A check of one part of a session, whose medium may have been changed: what is missing may lie at the others."""
    if check.verdict is not Verdict.REFUTED:
        return check
    judged = Check(check.name, check.text)
    for verdict, text in check.lines:
        judged.add(Verdict.LOSS if verdict is Verdict.REFUTED else verdict, text)
    places = ", ".join(map(str, elsewhere))
    judged.add(Verdict.LOSS, f"this may be a part of the session only: more of it may lie in {places}; give all")
    return judged


def apart(recording: Recording) -> bool:
    """Are frames of snapshots and the ledgers that tell of them not both here?"""
    return not recording.raw_files or (recording.snapshot_mode and not recording.path.is_dir())


class _Session:
    """The checks.  alone : one file of a session, whose neighbours are not looked at."""

    def __init__(
        self,
        recording: Recording,
        numbers: NumberProof,
        ledger: LedgerProof,
        gaps: Gaps,
        *,
        begins: bool,
        alone: bool,
    ) -> None:
        self._recording = recording
        self._numbers = numbers
        self._ledger = ledger
        self._gaps = gaps
        self._alone = alone
        ranges = numbers.coverage.ranges
        self._begin = 0 if begins else ranges[0].first if ranges else 0
        self._end = max([ranges[-1].last + 1 if ranges else 0, *(run.end for run in ledger.runs)])
        self._apart = apart(recording)
        self._holes = {id(run): ledger.holes(run) for run in ledger.runs}
        self.missing = 0 if self._apart else sum(h.count for h in numbers.coverage.holes(self._begin, self._end))

    # ------------------------------------------------------------------------------------------------ splits, numbers

    def splits(self) -> Check:
        """Is every file there?"""
        recording = self._recording
        check = Check("splits", f"{len(recording.raw_files)} raw files, none is missing")
        if not recording.raw_files:
            check.text = "no raw file"
            whole = self._alone or recording.reprocessed or not (recording.derived_files or recording.snapshot_files)
            check.add(Verdict.TOLD if whole else Verdict.LOSS, "no raw file is here: what came in is not proved")
        for kind in ("raw", "derived", "snapshot") if not self._alone else ():
            given_up, missing = absent_numbers(recording, kind)
            if missing:
                check.add(Verdict.REFUTED, f"{kind} files {ranges_text(missing)} are missing")
            if given_up:
                numbers = ranges_text([(n, n) for n in given_up])
                check.add(Verdict.TOLD, f"{kind} numbers {numbers} were given up: no file was opened in time")
        return check

    def sequence(self) -> Check:
        """Is every number there, once?"""
        numbers = self._numbers
        check = Check("sequence", f"numbers {self._begin} to {self._end - 1}, each once")
        if numbers.doubles:
            check.add(Verdict.REFUTED, f"{numbers.doubles} numbers stand twice in a file")
        if numbers.repeated:
            check.add(Verdict.TOLD, f"{numbers.repeated} numbers stand in two files, as where the medium was changed")
        for topic in numbers.topics.values():
            if topic.unordered:
                check.add(Verdict.REFUTED, f"{topic.name}: the numbers do not rise {topic.unordered} times")
        if self._apart:
            check.text = f"{numbers.frames} numbers, each once"
            check.add(
                Verdict.TOLD, "frames around triggers stand apart from the books: the folder proves both together"
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
            check.add(Verdict.TOLD, f"{_missing(holes)}; they may stand in the file before")
        elif holes:
            check.add(Verdict.REFUTED, f"{_missing(holes)}; no ledger accounts for them")

    def _judge_before(self, check: Check, run: Run) -> None:
        """Numbers before the last ledger of a recorder: it must account for every one."""
        holes = self._holes[id(run)][0]
        count = sum(hole.count for hole in holes)
        known = sum(books.missing.frames for books in run.topics.values())
        if count != known or any(books.refuted for books in run.topics.values()):
            what = _missing(holes) if holes else "no number is missing"
            check.add(Verdict.REFUTED, f"{what}; by the ledger of {clock_text(run.last.t_ns)} it should be {known}")
        elif holes:
            told = sum(hole.count for hole in holes if self._gaps.explains(hole))
            by = f"the ledger accounts for all, notes of gaps for {told}"
            check.add(self._verdict(run), f"{_missing(holes)}; {by}")

    def _verdict(self, run: Run) -> Verdict:
        """Frames for which no trigger came are no loss."""
        reasons = {reason for books in run.topics.values() for reason in books.entry.dropped}
        lost = reasons - {NOT_TRIGGERED, SOCKET_QUEUE} or any(books.unwritten for books in run.topics.values())
        return Verdict.LOSS if lost else Verdict.TOLD

    def _judge_after(self, check: Check, run: Run) -> None:
        """Numbers after the last ledger of a recorder."""
        holes = self._holes[id(run)][1]
        if not holes:
            return
        if run.last.final:
            check.add(Verdict.REFUTED, f"{_missing(holes)}; they came after the last word of their recorder")
        elif self._alone:
            check.add(Verdict.TOLD, f"{_missing(holes)}; they may stand in the next file")
        else:
            check.add(Verdict.LOSS, f"{_missing(holes)}; they were received and never written")

    # -------------------------------------------------------------------------------------------------- stamps, ticks

    def stamps(self) -> Check:
        """Does the time of every link run forward, and is it that of the arrival?"""
        check = Check("stamps", "the time of every link runs forward")
        for topic in self._numbers.topics.values():
            if topic.backwards:
                check.add(Verdict.REFUTED, f"{topic.name}: the time goes back {topic.backwards} times")
        for account in self.accounts():
            if count := account.stamps_refused:
                late = f"{count} frames have the time of their reading: the kernel's timestamps were refused"
                check.add(Verdict.LOSS, f"{account.topic}: {late}")
        return check

    def ticks(self) -> Check:
        """Was the recorder running all the time?"""
        topic = self._numbers.topics.get(TICK_TOPIC)
        count, gap = (topic.frames, topic.longest_gap_ns) if topic else (0, 0)
        check = Check("ticks", f"{count} ticks, the longest time between two is {gap / 1e6:.0f} ms")
        for begin, end in self._numbers.tick_holes:
            if end - begin > TICK_HOLE_NS:
                check.add(Verdict.TOLD, f"none for {(end - begin) / 1e9:.2f} s from {clock_text(begin)} on")
        return check

    # ---------------------------------------------------------------------------------------------- ledger, recorders

    def books(self) -> Check:
        """Does every ledger agree with the files?"""
        ledger = self._ledger
        check = Check("ledger", f"{ledger.notes} ledgers agree with what the files hold")
        for finding in ledger.findings:
            check.add(Verdict.REFUTED, finding)
        if ledger.unreadable:
            check.add(Verdict.REFUTED, f"{ledger.unreadable} ledgers cannot be read")
        if not ledger.notes:
            check.text = "there is none: what came in is not known"
            check.add(Verdict.LOSS, "no ledger stands in these files: whether all that came in is here is not proved")
        for account in self.accounts():
            for reason, amount in account.dropped.items():
                size = f" ({amount.bytes} bytes)" if amount.bytes else ""
                verdict = Verdict.TOLD if reason == NOT_TRIGGERED else Verdict.LOSS
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

    def _tell_end(self, check: Check, run: Run, after: Run | None) -> None:
        """A recorder without a last word: what is known of its last moments, and what cannot be."""
        until = clock_text(run.last.t_ns)
        if after is None and self._alone:
            check.add(Verdict.TOLD, f"its last ledger here is of {until}; it goes on in another file, or was killed")
            return
        if after is None and self._recording.raw_files and is_being_written(self._recording.raw_files[-1]):
            check.add(Verdict.LOSS, "the session is being recorded; what is held in buffers now is not known")
            return
        behind = max(run.end - run.last.next_seq, 0)
        holes = self._holes[id(run)][1]
        lost = sum(hole.count for hole in holes)
        shown = f"{lost} of them are missing: received and never written{_when(holes)}" if lost else "none is missing"
        text = f"recorder {run.recorder.pid} ended without a last word after its ledger of {until}; "
        text += f"it gave {behind} numbers more, {shown}"
        if after is None:
            text += "; whether it received more cannot be known"
        else:
            text += self._nobody_listened(after)
        check.add(Verdict.LOSS, text)

    def _nobody_listened(self, after: Run) -> str:
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
                check.add(Verdict.REFUTED, f"{gap.link}: the note tells that {told}")
        if gaps.unreadable:
            check.add(Verdict.REFUTED, f"{gaps.unreadable} notes of gaps cannot be read")
        for text in gaps.told:
            check.add(Verdict.TOLD, text)
        if gaps.untold:
            check.add(Verdict.TOLD, f"and {gaps.untold} more")
        return check

    # --------------------------------------------------------------------------------------------------------- accounts

    def accounts(self) -> list[Account]:
        """In = recorded + dropped by reason, for every topic, over all recorders."""
        topics = {topic for run in self._ledger.runs for topic in run.topics} | self._numbers.topics.keys()
        return [self._account(topic) for topic in sorted(topics - {TICK_TOPIC})]

    def _account(self, topic: str) -> Account:
        proof = self._numbers.topics.get(topic)
        account = Account(topic, Amount(proof.frames, proof.bytes) if proof else Amount())
        for run in self._ledger.runs:
            books = run.topics.get(topic)
            if books is None:
                continue
            base = books.base.dropped if books.base else {}
            for reason, amount in books.entry.dropped.items():
                _add(account.dropped, reason, amount.minus(base.get(reason, Amount())))
            unwritten = books.missing.minus(books.dropped)
            _add(account.dropped, STORAGE if run.last.final else NEVER_WRITTEN, unwritten)
            for name, count in books.entry.errors.items():
                account.errors[name] = account.errors.get(name, 0) + count
            account.stamps_refused += books.entry.stamps_refused - (books.base.stamps_refused if books.base else 0)
        return account


def _add(dropped: dict[str, Amount], reason: str, amount: Amount) -> None:
    if amount.frames > 0:
        dropped[reason] = dropped.get(reason, Amount()).plus(amount)


def _missing(holes: list[Span]) -> str:
    count = sum(hole.count for hole in holes)
    return f"{count} numbers are missing: {ranges_text([(hole.first, hole.last) for hole in holes])}{_when(holes)}"


def _when(holes: list[Span]) -> str:
    """The time in which they came."""
    begin, end = min(hole.first_ns for hole in holes), max(hole.last_ns for hole in holes)
    return f" ({clock_text(begin)} to {clock_text(end)})" if begin else ""
