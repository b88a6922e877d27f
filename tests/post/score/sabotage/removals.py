"""Falsifications that take messages away."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import Falsification, Sample, of_topics, outputs
from tests.post.score.sabotage.message_edits import Forgery

#: Where a hole begins, as a share of the flight.
HOLE_AT = 0.45


def devices(sample: Sample) -> list[str]:
    """The names of the devices that have measurements, with slashes around them."""
    first = {topic.split("/")[1] for topic in sample.session.topics("derived")}
    return [f"/{name}/" for name in sorted(first - {"nav", "fti"})]


def links(sample: Sample) -> list[str]:
    """The topics of the links on which frames arrived."""
    return sample.session.topics("raw", "/raw/")


def of_recorder(sample: Sample) -> list[str]:
    """Ticks, health, ledger: what comes at a rate."""
    return [topic for topic in sample.session.topics("raw", "/fti/") if topic not in ("/fti/event", "/fti/alarm")]


def _keep(kind: str, when: Callable[[Forgery, float], bool]) -> Callable[[Forgery, str], None]:
    """Keeps the messages of a topic, or of all topics below it, of the times at which ``when`` holds."""

    def apply(forgery: Forgery, place: str) -> None:
        assert kind in ("raw", "derived")
        topics = [place] if not place.endswith("/") else forgery.session.topics(kind, place)  # type: ignore[arg-type]

        def change(item: McapMessage) -> Iterable[McapMessage]:
            return [item] if when(forgery, forgery.session.seconds(item.log_time)) else []

        forgery.edit(kind, topics, change)  # type: ignore[arg-type]

    return apply


def _hole(length_s: float) -> Callable[[Forgery, float], bool]:
    def outside(forgery: Forgery, t: float) -> bool:
        begin = HOLE_AT * forgery.session.end_s
        return not begin <= t < begin + length_s

    return outside


def _thin(forgery: Forgery, topic: str) -> None:
    forgery.rearrange("derived", topic, lambda items: items[::2])


def _remove_frames(forgery: Forgery, topic: str) -> None:
    _keep("raw", lambda forgery, t: False)(forgery, topic)


def _remove_frames_and_renumber(forgery: Forgery, topic: str) -> None:
    _remove_frames(forgery, topic)
    forgery.renumber()


RATE = "the rate of each output that the configuration promises holds from the begin of navigation to the end"

REMOVALS: Sequence[Falsification] = (
    Falsification("delete output", RATE, of_topics(outputs, _keep("derived", lambda forgery, t: False))),
    Falsification(
        "delete all outputs",
        RATE,
        of_topics(lambda sample: ["/nav/"][: len(sample.outputs)], _keep("derived", lambda forgery, t: False)),
    ),
    Falsification(
        "output ends at 25 %",
        RATE,
        of_topics(outputs, _keep("derived", lambda forgery, t: t < 0.25 * forgery.session.end_s)),
    ),
    Falsification(
        "output ends 16 s early",
        RATE,
        of_topics(outputs, _keep("derived", lambda forgery, t: t < forgery.session.end_s - 16.0)),
    ),
    Falsification(
        "output begins at 40 %",
        RATE,
        of_topics(outputs, _keep("derived", lambda forgery, t: t >= 0.4 * forgery.session.end_s)),
    ),
    Falsification(
        "all outputs end at 25 %",
        RATE,
        of_topics(
            lambda sample: ["/nav/"][: len(sample.outputs)],
            _keep("derived", lambda forgery, t: t < 0.25 * forgery.session.end_s),
        ),
    ),
    Falsification(
        "hole of 2 s in output",
        "2 s are four periods of the slowest output and more than each output may be late",
        of_topics(outputs, _keep("derived", _hole(2.0))),
    ),
    Falsification("hole of 5 s in output", RATE, of_topics(outputs, _keep("derived", _hole(5.0)))),
    Falsification("half the rate of output", RATE, of_topics(outputs, _thin)),
    Falsification(
        "delete measurements of device",
        "a device whose frames are recorded and understood has measurements",
        of_topics(devices, _keep("derived", lambda forgery, t: False)),
    ),
    Falsification(
        "measurements of device end at 25 %",
        "a device whose frames are recorded and understood has measurements until the end",
        of_topics(devices, _keep("derived", lambda forgery, t: t < 0.25 * forgery.session.end_s)),
    ),
    Falsification(
        "delete frames of link",
        "each device sends at the rate of the configuration, so its link has frames; the numbers of the recorder show "
        "the missing ones",
        of_topics(links, _remove_frames),
    ),
    Falsification(
        "delete frames of link, renumber the others",
        "each device sends at the rate of the configuration, so its link has frames; health counts them",
        of_topics(links, _remove_frames_and_renumber),
    ),
    Falsification(
        "delete ticks, health or ledger",
        "the recorder writes ticks every 20 ms, health and ledger every second, for the whole flight",
        of_topics(of_recorder, _keep("raw", lambda forgery, t: False)),
    ),
    Falsification(
        "ticks, health or ledger end at 25 %",
        "the recorder writes ticks every 20 ms, health and ledger every second, for the whole flight",
        of_topics(of_recorder, _keep("raw", lambda forgery, t: t < 0.25 * forgery.session.end_s)),
    ),
)
