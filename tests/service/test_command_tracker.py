"""Commands: authorised, sent exactly once, matched to the answer of the device, each step reported."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fti.messages.control import DeviceAnswer
from fti.messages.tables import to_table
from fti.service.supervisor.command_catalogue import CommandDenied
from fti.service.supervisor.command_request import CommandState
from fti.service.supervisor.command_tracker import LATE_NS, MAX_EARLY_ANSWERS, MAX_OPEN, MAX_UNEXPECTED
from tests.helpers import until_async
from tests.service.command_bench import SECOND_NS, Bench, make_catalogue


@pytest.fixture
def bench() -> Bench:
    return Bench()


# -------------------------------------------------------------------------------------------------------- authorised


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"device": "none"}, "unknown device 'none'; configured: mag, other, shut, gnss"),
        ({"name": "halt"}, "mag (d): unknown command 'halt'; commands: rate, reset"),
        ({"device": "gnss"}, "gnss (d): unknown command 'rate'; its driver has no commands"),
        (
            {"device": "shut"},
            'shut: its link does not transmit; set transmit = true at [[link]] name = "mute" of a.toml',
        ),
        ({"args": {"rate": "21"}}, "mag: rate = 21: must be 1 to 20 Hz"),
        ({"args": {"rate": 10}}, "args must be texts by name"),
        ({"args": ["rate"]}, "args must be texts by name"),
        ({"args": {"rate": "1" * 2000}}, "device, command and args must have at most 2000 characters together"),
        ({"device": "m" * 2000}, "device, command and args must have at most 2000 characters together"),
        ({"device": 7}, "device and command must be texts"),
        ({"key": ""}, "id must have 1 to 100 characters"),
        ({"key": "x" * 101}, "id must have 1 to 100 characters"),
        ({"timeout_s": 0}, "timeout_s must be more than 0 and at most 600 seconds"),
        ({"timeout_s": float("nan")}, "timeout_s must be more than 0 and at most 600 seconds"),
        ({"timeout_s": "3"}, "timeout_s must be more than 0 and at most 600 seconds"),
    ],
)
async def test_a_denied_command_is_not_sent_and_has_a_reason(bench: Bench, fields: dict[str, Any], why: str) -> None:
    assert await bench.ask(**fields) == {"fault": why}
    assert bench.sent == []
    assert bench.events == [("warning", f"not sent for an engineer: {why}")]
    assert [shown["state"] for shown in bench.shown] == ["denied"]


def test_the_catalogue_teaches() -> None:
    catalogue = make_catalogue()
    known = {device.name: to_table(device) for device in catalogue.describe()}
    assert list(known) == ["mag", "other", "shut", "gnss"]
    assert known["mag"]["commands"]["rate"]["arguments"] == {"rate": "Hz, 1 to 20"}
    assert [known[name]["transmit"] for name in known] == [True, True, False, True]
    assert [device.name for device in catalogue.usable()] == ["mag", "other"]
    with pytest.raises(CommandDenied):
        catalogue.encode("shut", "reset", {})


# ----------------------------------------------------------------------------------------------------- the good way


async def test_a_command_is_sent_acknowledged_and_reported(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    until_ns = 40 * SECOND_NS
    assert bench.sent == [{"id": 1, "link": "line", "data": b"*rate10\r".hex(), "until_ns": until_ns}]
    bench.confirm_sending()
    bench.clock.advance(0.034)
    bench.answer()
    found = await task
    assert (found["state"], found["number"], found["id"], found["who"]) == ("acknowledged", 1, "k1", "an engineer")
    assert bench.events == [
        ("info", "1: mag rate rate=10 for an engineer: 2a7261746531300d"),
        ("info", "1: mag rate rate=10: acknowledged after 34 ms"),
    ]
    assert [shown["state"] for shown in bench.shown] == ["sending", "waiting", "acknowledged"]


async def test_a_device_may_refuse(bench: Bench) -> None:
    task = await bench.ask_and_send()
    bench.answer(accepted=False, detail="write protected")
    assert (await task)["state"] == "refused"
    assert bench.events[-1] == ("warning", "1: mag rate rate=10: refused after 0 ms: write protected")


async def test_what_is_never_acknowledged_ends_when_it_is_sent(bench: Bench) -> None:
    task = await (await bench.ask_and_send("k1", "reset"))
    assert (task["state"], task["detail"]) == ("sent", "the device does not acknowledge it")
    assert bench.events[-1][0] == "info"


async def test_what_cannot_be_sent_is_reported(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    bench.confirm_sending(fault="link line: is not connected")
    assert (await task)["state"] == "not sent"
    assert bench.events[-1] == ("warning", "1: mag rate rate=10: not sent: link line: is not connected")


async def test_what_went_out_in_part_is_not_reported_as_not_sent(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    bench.confirm_sending(fault="nothing was taken for 3 s; its first 5 bytes are sent", partly=True)
    assert (await task)["state"] == "unknown"
    bench.answer()
    assert bench.events[-1][1].startswith("1: mag rate rate=10: late answer: acknowledged")


# ----------------------------------------------------------------------------------------------------- exactly once


async def test_the_same_id_is_sent_once_and_answered_as_the_first(bench: Bench) -> None:
    first, second = bench.ask(), bench.ask()
    await until_async(lambda: bench.sent)
    bench.confirm_sending()
    bench.answer()
    third = bench.ask(timeout_s=5.0)
    answers = [await first, await second, await third]
    assert answers[0] == answers[1] == answers[2]
    assert len(bench.sent) == 1
    assert await bench.ask(name="reset") == {"fault": "id 'k1' is already used by another command"}
    assert len(bench.sent) == 1


async def test_what_was_denied_stays_denied(bench: Bench) -> None:
    bench.command_tracker.close()
    assert await bench.ask() == await bench.ask() == {"fault": "the session is ending; no more commands are sent"}


async def test_a_client_that_goes_takes_nothing_with_it(bench: Bench) -> None:
    task = await bench.ask_and_send()
    task.cancel()
    again = bench.ask()
    bench.answer()
    assert (await again)["state"] == "acknowledged"
    assert len(bench.sent) == 1


# ---------------------------------------------------------------------------------------------------------- matching


async def test_an_answer_goes_to_the_oldest_of_its_device_and_name(bench: Bench) -> None:
    first = await bench.ask_and_send("a")
    other = await bench.ask_and_send("b", device="other")
    second = await bench.ask_and_send("c")
    bench.answer("", device="other", accepted=False)
    bench.answer("reset")  # is none of those that wait
    assert bench.events[-1] == ("info", "mag: acknowledged reset: unexpected answer")
    bench.answer("")
    bench.answer("rate", accepted=False)
    states = [(await task)["state"] for task in (first, other, second)]
    assert states == ["acknowledged", "refused", "refused"]


async def test_an_answer_from_before_is_none(bench: Bench) -> None:
    bench.answer("")
    bench.clock.advance(1.0)
    task = await bench.ask_and_send()
    t_ns = bench.clock.now_ns() - SECOND_NS
    bench.command_tracker.on_ack(DeviceAnswer(device="mag", t_ns=t_ns, command="", accepted=False, detail=""))
    bench.answer("")
    assert (await task)["state"] == "acknowledged"
    assert [text for _, text in bench.events if "unexpected answer" in text] == [
        "mag: acknowledged an unnamed command: unexpected answer",
        "mag: refused an unnamed command: unexpected answer",
    ]


async def test_an_answer_may_come_before_the_word_that_it_was_sent(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    bench.answer("", accepted=False)  # to a question of before: our command was sent later
    bench.clock.advance(1.0)
    bench.answer("")
    bench.confirm_sending()
    assert (await task)["state"] == "acknowledged"
    assert bench.events[-2] == ("warning", "mag: refused an unnamed command: unexpected answer")


async def test_a_device_that_answers_without_end_fills_no_memory(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    for _ in range(MAX_EARLY_ANSWERS + 5):
        bench.answer("")
    assert sum("unexpected answer" in text for _, text in bench.events) == 5
    bench.confirm_sending()
    assert (await task)["state"] == "acknowledged"


async def test_an_answer_before_a_fault_was_to_something_else(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    bench.answer("")
    bench.confirm_sending(fault="the line was not quiet")
    assert (await task)["state"] == "not sent"
    assert bench.events[-1] == ("info", "mag: acknowledged an unnamed command: unexpected answer")


async def test_what_answers_the_questions_of_the_recorder_is_no_news_unless_it_is_a_refusal(bench: Bench) -> None:
    bench.answer("read_table", device="gnss")
    assert bench.events == []
    bench.answer("read_table", device="gnss", accepted=False)
    assert bench.events == [("warning", "gnss: refused read_table: unexpected answer")]


async def test_answers_that_nobody_asked_for_do_not_flood_the_log(bench: Bench) -> None:
    for _ in range(100):
        bench.answer("", detail="OK")
    assert len(bench.events) == MAX_UNEXPECTED
    bench.clock.advance(11.0)
    bench.answer("")
    assert bench.events[-1][1].endswith("unexpected answer; 80 earlier answers were not reported")


# ---------------------------------------------------------------------------------------------------------- no answer


async def test_silence_is_timed_out_and_a_late_answer_reported(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "fti.service.supervisor.command_tracker.CONFIRMATION_MARGIN_S", 600.0
    )  # what is waited for the recorder counts no more
    bench.hint = "navigation is 7.0 s behind"
    task = await bench.ask_and_send(timeout_s=0.02)
    result = await task
    assert (result["state"], result["detail"]) == ("timed out", "no answer within 0.02 s; navigation is 7.0 s behind")
    bench.clock.advance(5.0)
    bench.answer("", detail="OK")
    assert bench.events[-1] == ("warning", "1: mag rate rate=10: late answer: acknowledged after 5.0 s: OK")
    bench.answer("")
    assert "unexpected answer" in bench.events[-1][1]
    assert (await bench.ask())["state"] == "timed out"  # the first answer stays


async def test_an_answer_without_a_name_after_a_time_out_is_doubted(bench: Bench) -> None:
    await (await bench.ask_and_send(timeout_s=0.02))
    task = await bench.ask_and_send("k2")
    bench.answer("", detail="OK")
    assert (await task)["detail"] == "OK; it may be the late answer to 1"
    task = await bench.ask_and_send("k2b", "rate")
    bench.answer("rate")
    assert (await task)["detail"] == "it may be the late answer to 1"
    bench.clock.advance(LATE_NS / SECOND_NS + 1.0)
    task = await bench.ask_and_send("k3")
    bench.answer("")
    assert (await task)["detail"] == ""


async def test_a_silent_recorder_leaves_it_unknown(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fti.service.supervisor.command_tracker.CONFIRMATION_MARGIN_S", 0.02)
    task = bench.ask(timeout_s=0.02)
    found = await task
    assert (found["state"], found["detail"]) == ("unknown", "the recorder has not confirmed sending within 0.02 s")


async def test_without_a_recorder_nothing_is_sent(bench: Bench) -> None:
    bench.there = False
    found = await bench.ask()
    assert (found["state"], found["detail"]) == ("not sent", "the recorder is restarting")
    bench.there = True
    assert (await bench.ask())["state"] == "not sent"  # the same request
    assert bench.sent == []


async def test_a_recorder_that_dies_before_its_word_leaves_it_unknown(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    bench.command_tracker.on_child_ended("recorder")
    found = await task
    assert found["state"] == "unknown"
    assert found["detail"] == "the recorder ended before it confirmed sending"
    bench.answer()
    assert "late answer: acknowledged" in bench.events[-1][1]


async def test_the_answer_confirms_sending_if_the_recorder_cannot(bench: Bench) -> None:
    task = bench.ask()
    await until_async(lambda: bench.sent)
    bench.answer()
    bench.command_tracker.on_child_ended("recorder")
    assert (await task)["state"] == "acknowledged"


@pytest.mark.parametrize("child", ["recorder", "navigation"])
async def test_a_restart_between_sending_and_answer_is_reported(bench: Bench, child: str) -> None:
    task = await bench.ask_and_send(timeout_s=0.05)
    bench.command_tracker.on_child_ended(child)
    assert (await task)["detail"] == f"no answer within 0.05 s; {child} was restarted meanwhile"
    again = await bench.ask_and_send("k2")
    bench.command_tracker.on_child_ended(child)
    bench.answer()
    assert (await again)["state"] == "acknowledged"


async def test_the_end_of_the_session_ends_every_command(bench: Bench) -> None:
    waiting = await bench.ask_and_send()
    sending = bench.ask("k2")
    await until_async(lambda: len(bench.sent) == 2)
    bench.command_tracker.close()
    assert (await waiting)["detail"] == "sent, but the session ended before an answer came"
    assert (await sending)["detail"] == "passed to the recorder, but the session ended before an answer came"
    assert (await bench.ask("k3"))["fault"] == "the session is ending; no more commands are sent"
    assert len(bench.sent) == 2


async def test_commands_that_wait_are_bounded(bench: Bench) -> None:
    task = [bench.ask(f"k{n}") for n in range(MAX_OPEN + 1)]
    assert (await task[-1])["fault"] == f"mag: {MAX_OPEN} commands are already open"
    assert len(bench.sent) == MAX_OPEN
    bench.command_tracker.close()
    assert [(await one)["state"] for one in task[:-1]] == [CommandState.UNKNOWN] * MAX_OPEN


async def test_the_page_gets_the_last_ones(bench: Bench) -> None:
    for n in range(30):
        await (await bench.ask_and_send(f"k{n}", "reset"))
    assert [request.number for request in bench.command_tracker.recent()] == list(range(11, 31))


# ---------------------------------------------------------------------------------------------------- in any order

NAMES = st.sampled_from(["", "rate", "reset"])
STEPS = st.one_of(
    st.tuples(st.just("ask"), st.sampled_from("abcd"), st.sampled_from(["rate", "reset"])),
    st.tuples(st.just("sent"), st.integers(1, 5), st.sampled_from([None, "link down"])),
    st.tuples(st.just("answer"), NAMES, st.booleans()),
    st.tuples(st.just("ended"), st.sampled_from(["recorder", "navigation"]), st.none()),
    st.tuples(st.just("later"), st.none(), st.none()),
)


@example([("ask", "a", "rate"), ("ask", "b", "rate"), ("sent", 2, None), ("answer", "", True)])
@given(st.lists(STEPS, max_size=25))
def test_whatever_happens_each_command_is_sent_once_and_ends_once(steps: list[tuple[str, Any, Any]]) -> None:
    bench = asyncio.run(_play(steps))
    keys = [shown["id"] for shown in bench.shown if shown["state"] == "sending"]
    assert len(keys) == len(set(keys)) == len(bench.sent)
    ends = [shown["id"] for shown in bench.shown if shown["ended"] and shown["number"]]
    assert sorted(ends) == sorted(keys)
    texts = [text for _, text in bench.events if "an engineer: 2a" in text]
    assert len(texts) == len(keys)


async def _play(steps: list[tuple[str, Any, Any]]) -> Bench:
    bench = Bench()
    for step, first, second in steps:
        if step == "ask":
            request = {"id": first, "device": "mag", "command": second, "timeout_s": 600}
            bench.command_tracker.begin(request | {"args": {"rate": "10"} if second == "rate" else {}}, "an engineer")
        elif step == "sent":
            bench.confirm_sending(first, second)
        elif step == "answer":
            bench.answer(first, second)
        elif step == "ended":
            bench.command_tracker.on_child_ended(first)
        else:
            bench.clock.advance(1.0)
    bench.command_tracker.close()
    return bench
