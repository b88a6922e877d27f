"""Falsifications of expected flags: hidden wherever they stand, or standing for ever.

The flags are those that the score found in the honest session; how each is told in a message is stated here once more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import orjson

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import Falsification, Sample, Target
from tests.post.score.sabotage.message_edits import Forgery, Table

DEVICES, LINKS, LEDGER, EVENT = "/fti/health/devices/", "/fti/health/links/", "/fti/ledger/", "/fti/event"
ALARM = "/fti/alarm"
HEALTH = "/fti/health"
STATES = ("silent", "noise", "invalid", "wrong rate")
#: A flag that must have gone less than this before the end may stand to the end [s].
BEFORE_END_S = 3.0
#: A bench that was late so long before or after a flag explains it [s].
BEFORE_S = 6.0


@dataclass(frozen=True)
class Flag:
    """An expected flag that stands in the honest session.

    place, words : as the score names them; value : a number instead of words
    from_s, until_s : of its cause [s]; stands_s, gone_s : when it must stand, and must have gone [s]; None: unchecked
    """

    place: str
    words: tuple[str, ...]
    value: float | None
    from_s: float
    until_s: float
    stands_s: float
    clear_limit_s: float | None

    @property
    def name(self) -> str:
        """Place and words."""
        return f"{self.place} {' or '.join(self.words)}".strip() + ("" if self.value is None else f" = {self.value:g}")


def flags_of(sample: Sample) -> list[Flag]:
    """Every flag that the honest session raises in time, and no late bench explains; of several faults the first."""
    flags: dict[str, Flag] = {}
    for score in sample.honest.report:
        for row in score["rows"]:
            if row.get("verdict") == "found" and isinstance(row.get("flag"), str):
                flag = _parse(row)
                if not sample.session.was_late(
                    flag.from_s - BEFORE_S, (flag.clear_limit_s or flag.stands_s) + BEFORE_S
                ):
                    flags.setdefault(flag.name, flag)
    return list(flags.values())


def _parse(row: dict[str, Any]) -> Flag:
    place, _, rest = row["flag"].partition(" ")
    value = float(rest.removeprefix("= ")) if rest.startswith("= ") else None
    words = () if value is not None else tuple(rest.split(" or "))
    clear_limit_s = row["until_s"] + row["clears_s"] if row.get("clears_s") is not None else None
    return Flag(
        place, words, value, row["from_s"], row["until_s"], row["from_s"] + (row["within_s"] or 0.0), clear_limit_s
    )


# --------------------------------------------------------------------------------------------------------- hidden


def hide(forgery: Forgery, flag: Flag) -> None:
    """No message states the flag any more."""
    if flag.value is not None:
        _hide_value(forgery, flag)
    elif flag.place.startswith("/nav/"):
        forgery.edit_tables("derived", [flag.place], _hide_in_output(forgery, flag))
    elif flag.place.startswith(HEALTH):
        forgery.edit_notes(HEALTH, _hide_in_health(flag))
    elif flag.place.startswith(LEDGER):
        forgery.edit_notes("/fti/ledger", _hide_in_ledger(flag))
    elif flag.place.startswith(EVENT):
        _hide_event(forgery, flag)
    elif flag.place == ALARM:
        _drop_changes(forgery, flag.words, ("begins", "changes", "ends", "acknowledged"))
    else:
        topics = forgery.session.topics("derived", flag.place)
        forgery.edit_tables("derived", topics, _hide_by_device(flag))


def _hide_value(forgery: Forgery, flag: Flag) -> None:
    topic, _, name = flag.place.rpartition(".")
    first: list[object] = []

    def change(table: Table, t: float) -> None:
        if table.get(name) is not None:
            first[:] = first or [table[name]]
            table[name] = first[0]

    forgery.edit_tables("derived", [topic], change)


def _hide_in_output(forgery: Forgery, flag: Flag) -> Callable[[Table, float], None]:
    usual: dict[str, object] = {}

    def change(table: Table, t: float) -> None:
        for role in ("position", "attitude"):
            key = f"{role}_source"
            if key in table and any(word.startswith(f"{role} ") for word in flag.words):
                if table[key]:
                    usual.setdefault(key, table[key])
                table[key] = usual.get(key)
        _remove_words(table, "reasons", flag.words)
        _remove_words(table, "unchecked", flag.words)
        if table.get("state") in flag.words:
            table["state"] = "ok"

    return change


def _remove_words(table: Table, name: str, words: Sequence[str]) -> None:
    before = table.get(name)
    if before and set(before) & set(words):
        table[name] = [word for word in before if word not in words]
        if name == "reasons" and not table[name]:
            table["valid"] = True


def _hide_in_health(flag: Flag) -> Callable[[Table, float], None]:
    kind, name = flag.place.split("/")[3:5]
    first: list[object] = []

    def change(note: Table, t: float) -> None:
        entry = note[kind].get(name)
        if entry is None:
            return
        if entry["state"] in flag.words:
            entry["state"], entry["hint"] = "good", ""
        if "damaged bytes" in flag.words:
            first[:] = first or [entry.get("skipped", {})]
            entry["skipped"] = first[0]
        if "clock away" in flag.words:
            for clock in entry["clocks"]:
                clock["state"] = "good"

    return change


def _hide_in_ledger(flag: Flag) -> Callable[[Table, float], None]:
    link = flag.place.removeprefix(LEDGER)

    def change(note: Table, t: float) -> None:
        for word in flag.words:
            note["links"][link].get("errors", {}).pop(word, None)

    return change


def _hide_event(forgery: Forgery, flag: Flag) -> None:
    name = flag.place.removeprefix(f"{EVENT}/")

    def change(item: McapMessage) -> Iterable[McapMessage]:
        event = orjson.loads(item.data)
        return [] if event["name"] == name and event["message"] in flag.words else [item]

    for kind in ("raw", "derived"):
        forgery.edit(kind, [EVENT], change)


def _drop_changes(forgery: Forgery, alarms: Sequence[str], changes: Sequence[str]) -> None:
    """Without what was recorded of these alarms."""

    def change(item: McapMessage) -> Iterable[McapMessage]:
        alarm = orjson.loads(item.data)
        return [] if alarm["id"] in alarms and alarm["change"] in changes else [item]

    forgery.edit("raw", [ALARM], change)


def _hide_by_device(flag: Flag) -> Callable[[Table, float], None]:
    def change(table: Table, t: float) -> None:
        if "flags" in table:
            table["flags"] = [word for word in table["flags"] if word not in flag.words]
            table["ok"] = True
        if "invalid" in flag.words and "valid" in table:
            table["valid"] = True

    return change


# -------------------------------------------------------------------------------------------------------- for ever


def keep(forgery: Forgery, flag: Flag) -> None:
    """Every message from the end of the cause on states the flag."""
    if flag.place.startswith("/nav/"):
        forgery.edit_tables("derived", [flag.place], _keep_in_output(flag))
    elif flag.place.startswith(HEALTH):
        forgery.edit_notes(HEALTH, _keep_in_health(flag))
    elif flag.place.startswith(LEDGER):
        forgery.edit_notes("/fti/ledger", _keep_in_ledger(flag))
    elif flag.place == ALARM:
        _drop_changes(forgery, flag.words, ("ends",))
    elif not flag.place.startswith(EVENT):
        forgery.edit_tables("derived", forgery.session.topics("derived", flag.place), _keep_by_device(flag))


def _keep_in_output(flag: Flag) -> Callable[[Table, float], None]:
    word = flag.words[0]

    def change(table: Table, t: float) -> None:
        if t < flag.until_s:
            return
        role, _, origin = word.partition(" ")
        if f"{role}_source" in table:
            table[f"{role}_source"] = origin.removeprefix("from ") if origin.startswith("from ") else "spare"
        elif "reasons" in table:
            table["reasons"], table["valid"] = [*table["reasons"], word], False

    return change


def _keep_in_health(flag: Flag) -> Callable[[Table, float], None]:
    kind, name = flag.place.split("/")[3:5]

    def change(note: Table, t: float) -> None:
        entry = note[kind].get(name)
        if entry is None or t < flag.until_s:
            return
        if set(flag.words) & set(STATES):
            entry["state"] = flag.words[0]
        if "damaged bytes" in flag.words:
            entry["skipped"] = {**entry.get("skipped", {}), "checksum": 1000 + round(100 * t)}
        if "clock away" in flag.words:
            for clock in entry["clocks"]:
                clock["state"] = "away"

    return change


def _keep_in_ledger(flag: Flag) -> Callable[[Table, float], None]:
    link = flag.place.removeprefix(LEDGER)

    def change(note: Table, t: float) -> None:
        if t >= flag.until_s:
            note["links"][link]["errors"] = {flag.words[0]: 1000 + round(100 * t)}

    return change


def _keep_by_device(flag: Flag) -> Callable[[Table, float], None]:
    def change(table: Table, t: float) -> None:
        if t < flag.until_s:
            return
        if "flags" in table:
            table["flags"] = sorted({*table["flags"], *flag.words})
            table["ok"] = False
        if "invalid" in flag.words and "valid" in table:
            table["valid"] = False

    return change


def _hide_targets(sample: Sample) -> Iterator[Target]:
    for flag in flags_of(sample):
        yield Target(flag.name, lambda forgery, flag=flag: hide(forgery, flag))  # type: ignore[misc]


def _keep_targets(sample: Sample) -> Iterator[Target]:
    """Those whose end is compared: not that of a value, of an event, or of a flag that lasts to the end."""
    for flag in flags_of(sample):
        if flag.clear_limit_s is not None and flag.clear_limit_s < sample.session.end_s - BEFORE_END_S:
            yield Target(flag.name, lambda forgery, flag=flag: keep(forgery, flag))  # type: ignore[misc]


FLAGS: Sequence[Falsification] = (
    Falsification("expected flag hidden", "each fault of the scenario must raise its flags", _hide_targets),
    Falsification("flag never clears", "a flag must have gone some time after its cause", _keep_targets),
)
