"""Every reason and state has words."""

from fti.messages.outputs import IntegrityState
from fti.messages.reasons import Reason
from fti.reason_texts import REASONS, describe_reasons
from fti.web.live_state import STATES, describe_mode


def test_every_reason_has_words_of_its_own() -> None:
    assert set(REASONS) == set(Reason)
    assert len(set(REASONS.values())) == len(REASONS)


def test_every_state_has_words() -> None:
    assert set(STATES) == set(IntegrityState)


def test_an_unknown_reason_is_shown_as_it_is() -> None:
    assert describe_reasons(["of_the_future", "roll"]) == ["of the future", "roll limit"]
    assert describe_reasons(None) == []


def test_a_mode_has_a_banner() -> None:
    assert describe_mode("snapshot")[0] == "SNAPSHOT"
    assert describe_mode("other") == ("OTHER", "")
