"""Falsifications with another truth: of another flight, of another begin, incomplete."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import orjson

from fti.hil.truth_log import SCENARIO_ATTACHMENT
from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import Falsification, Sample, Target, once
from tests.post.score.sabotage.message_edits import Forgery
from tests.post.score.sabotage.session_copy import SECOND_NS, TRUTH, LogFile, Session

#: What is measured better than this: 6 m, half a metre per second.
ELSEWHERE = (("lat", 1e-6), ("lon", 1e-6), ("alt", 6.0), ("vel_north", 0.5), ("vel_east", 0.5))


def _shift(by_s: float) -> Callable[[Forgery], None]:
    """The flight begins at another time."""

    def change(item: McapMessage) -> list[McapMessage]:
        by_ns = round(by_s * SECOND_NS)
        row = orjson.loads(item.data)
        if "t_ns" in row:
            row["t_ns"] += by_ns
        log_time, publish_time = item.log_time + by_ns, item.publish_time + by_ns
        return [item._replace(data=orjson.dumps(row), log_time=log_time, publish_time=publish_time)]

    return lambda forgery: forgery.edit("truth", forgery.session.topics("truth"), change)


def _only(when: Callable[[float], bool]) -> Callable[[Forgery], None]:
    """The rows of these parts of the flight."""

    def apply(forgery: Forgery) -> None:
        end_s = forgery.session.end_s
        forgery.edit(
            "truth",
            forgery.session.topics("truth"),
            lambda item: [item] if when(forgery.session.seconds(item.log_time) / end_s) else [],
        )

    return apply


def _cut(forgery: Forgery) -> None:
    """The file ends in the middle of a record."""
    for file in forgery.session.files["truth"]:
        file.cut_share, file.changed = 0.5, True


def _delete(forgery: Forgery) -> None:
    forgery.session.files["truth"] = []
    forgery.session.files["raw"][0].changed = True


def _of_other(which: str) -> Callable[[Sample], Iterator[Target]]:
    """The truth file of another flight."""

    def targets(sample: Sample) -> Iterator[Target]:
        for name, folder in sample.others.items():
            if name.startswith(which):
                yield Target(name, _put_truth(folder))

    return targets


def _put_truth(folder: Path, *, renamed: bool = False) -> Callable[[Forgery], None]:
    """renamed : it says that it is of the scenario of the session"""

    def apply(forgery: Forgery) -> None:
        own = forgery.session.files["truth"][0].attachments[SCENARIO_ATTACHMENT]
        files = [file.copy() for file in Session.read(folder).files["truth"]]
        for file in files:
            file.changed = True
            if renamed:
                file.attachments[SCENARIO_ATTACHMENT] = own
        forgery.session.files["truth"] = files

    return apply


def _renamed_truth(sample: Sample) -> Iterator[Target]:
    for name, folder in sample.others.items():
        if _is_elsewhere(sample.session, Session.read(folder)):
            yield Target(name, _put_truth(folder, renamed=True))


def _is_elsewhere(session: Session, other: Session) -> bool:
    """Was the other flight somewhere else at the same time, or at another speed?"""
    rows = zip(_states(session), _states(other), strict=False)
    return any(abs(one[name] - two[name]) > minimum for one, two in rows for name, minimum in ELSEWHERE)


def _states(session: Session) -> list[dict[str, float]]:
    return [orjson.loads(item.data) for item in session.items("truth") if item.topic.name == TRUTH]


def _second_truth(sample: Sample) -> Iterator[Target]:
    """The truth of another flight lies beside the right one."""
    for name, folder in sample.others.items():
        yield Target(name, _add_truth(folder))


def _add_truth(folder: Path) -> Callable[[Forgery], None]:
    def apply(forgery: Forgery) -> None:
        forgery.session.files["truth"] += [_as_changed(file) for file in Session.read(folder).files["truth"]]

    return apply


def _as_changed(file: LogFile) -> LogFile:
    copy = file.copy()
    copy.changed = True
    return copy


def _other_session(sample: Sample) -> Iterator[Target]:
    """What another flight recorded, with the truth of this one."""
    for name, folder in sample.others.items():
        yield Target(name, _put_session(folder))


def _put_session(folder: Path) -> Callable[[Forgery], None]:
    def apply(forgery: Forgery) -> None:
        other = Session.read(folder)
        for kind in ("raw", "derived"):
            forgery.session.files[kind] = [_as_changed(file) for file in other.files[kind]]

    return apply


def _other_outputs(sample: Sample) -> Iterator[Target]:
    """What navigation made of another flight, beside the raw files of this one."""
    for name, folder in sample.others.items():
        yield Target(name, _put_derived(folder))


def _put_derived(folder: Path) -> Callable[[Forgery], None]:
    def apply(forgery: Forgery) -> None:
        forgery.session.files["derived"] = [_as_changed(file) for file in Session.read(folder).files["derived"]]

    return apply


OTHER = "it was flown along another path, or with other faults: errors and flags do not fit"
WHOLE = "the truth file has 25 rows a second from the begin of the flight to the end that its emulator noted"
TRUTHS: Sequence[Falsification] = (
    Falsification("truth begins 2 s later", "120 m along the track", once(_shift(2.0))),
    Falsification("truth begins 2 s earlier", "120 m along the track", once(_shift(-2.0))),
    Falsification("truth begins 600 s later", "the session has nothing of that time", once(_shift(600.0))),
    Falsification("truth file cut off", WHOLE, once(_cut)),
    Falsification("truth without its second half", WHOLE, once(_only(lambda share: share < 0.5))),
    Falsification("truth with a hole", WHOLE, once(_only(lambda share: not 0.4 <= share < 0.6))),
    Falsification("truth deleted", "without a truth nobody knows what was flown", once(_delete)),
    Falsification(
        "truth of another scenario", "the truth file says which scenario was flown", _of_other("other scenario")
    ),
    Falsification("truth of another seed", "the truth file says which seed was flown", _of_other("other seed")),
    Falsification("truth of another flight under the name of this one", OTHER, _renamed_truth),
    Falsification("truth of another flight beside the right one", OTHER, _second_truth),
    Falsification("session of another flight", OTHER, _other_session),
    Falsification("outputs of another flight", OTHER, _other_outputs),
)
