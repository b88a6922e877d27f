"""The attacker writes sessions as an honest writer would, so that nothing but the falsified content differs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import orjson
import pytest

from fti.logger.reading.mcap_file import McapMessage
from tests.logger.campaign.commands import fti
from tests.post.score.sabotage.falsification import Sample
from tests.post.score.sabotage.flights import fly_short, sample_of, short_file
from tests.post.score.sabotage.message_edits import Forgery
from tests.post.score.sabotage.score_run import run_score
from tests.post.score.sabotage.session_copy import KINDS, Session


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Sample:
    file = short_file(tmp_path_factory.mktemp("copy"))
    return sample_of(str(file), fly_short(file))


def rewritten(sample: Sample, folder: Path) -> Path:
    """The same session, with every file written again."""
    forgery = Forgery(sample.session)
    for kind in KINDS:
        forgery.session.replace(kind, list)
    return forgery.session.save(folder)


def test_a_copy_holds_the_same_messages_declarations_and_attachments(sample: Sample, tmp_path: Path) -> None:
    copy = Session.read(rewritten(sample, tmp_path))
    for kind in KINDS:
        for ours, theirs in zip(copy.files[kind], sample.session.files[kind], strict=True):
            assert ours.path != theirs.path
            assert ours.items == theirs.items
            assert ours.declared == theirs.declared
            assert ours.attachments == theirs.attachments
            assert ours.metadata == theirs.metadata


def test_verify_reports_the_same_for_a_copy_and_the_original(sample: Sample, tmp_path: Path) -> None:
    before, after = fti("verify", sample.session.folder), fti("verify", rewritten(sample, tmp_path))
    assert after.code == before.code
    assert after.text.replace(str(tmp_path), "") == before.text.replace(str(sample.session.folder.parent), "")


def test_a_copy_holds_its_score_with_the_same_rows(sample: Sample, tmp_path: Path) -> None:
    report = run_score(sample.scenario, rewritten(sample, tmp_path))
    assert sample.honest.holds
    assert report.holds
    assert report.results == sample.honest.results


def test_files_without_changes_are_the_same_files(sample: Sample, tmp_path: Path) -> None:
    forgery = Forgery(sample.session)
    forgery.edit("derived", ["/nav/nav_solution"], lambda item: [])
    saved = Session.read(forgery.session.save(tmp_path))
    assert saved.files["raw"][0].path.samefile(sample.session.files["raw"][0].path)
    assert not saved.files["derived"][0].path.samefile(sample.session.files["derived"][0].path)
    assert "/nav/nav_solution" not in saved.topics("derived")


def _nothing(forgery: Forgery) -> None:
    forgery.edit("derived", forgery.session.topics("derived"), lambda item: [item])


def _nothing_in_tables(forgery: Forgery) -> None:
    forgery.edit_tables("derived", forgery.session.topics("derived"), lambda table, t: None)


def _nothing_in_notes(forgery: Forgery) -> None:
    forgery.edit_notes("/fti/health", lambda note, t: None)


def _no_numbers(forgery: Forgery) -> None:
    forgery.renumber()


@pytest.mark.parametrize("edit", [_nothing, _nothing_in_tables, _nothing_in_notes, _no_numbers])
def test_an_edit_that_changes_nothing_is_no_change(sample: Sample, edit: Callable[[Forgery], None]) -> None:
    forgery = Forgery(sample.session)
    edit(forgery)
    assert not forgery.is_changed or list(forgery.session.items("raw")) == list(sample.session.items("raw"))


def test_an_edited_note_is_what_a_reader_finds(sample: Sample) -> None:
    """Health is stored as changes: a word in one note must not stay in the next."""
    forgery = Forgery(sample.session)

    def change(note: dict[str, object], t: float) -> None:
        note["hint"] = "edited" if 10.0 < t < 12.0 else ""

    forgery.edit_notes("/fti/health", change)
    again = Forgery(forgery.session)
    hints: dict[float, object] = {}
    again.edit_notes("/fti/health", lambda note, t: hints.update({t: note["hint"]}))
    assert {t for t, hint in hints.items() if hint} == {t for t in hints if 10.0 < t < 12.0}


def test_an_edit_leaves_the_session_that_it_was_made_from_alone(sample: Sample) -> None:
    before = list(sample.session.items("derived"))
    forgery = Forgery(sample.session)
    forgery.edit_tables("derived", ["/nav/nav_solution"], lambda table, t: table.update(valid=False))
    assert list(sample.session.items("derived")) == before
    changed = [item for item in forgery.session.items("derived") if item.topic.name == "/nav/nav_solution"]
    assert all(orjson.loads(item.data)["valid"] is False for item in changed)


def test_missing_frames_leave_no_gap_when_the_others_are_renumbered(sample: Sample) -> None:
    forgery = Forgery(sample.session)
    link = forgery.session.topics("raw", "/raw/")[0]
    forgery.edit("raw", [link], lambda item: list[McapMessage]())
    forgery.renumber()
    numbers = sorted(
        i.sequence for i in forgery.session.items("raw") if i.topic.name.startswith(("/raw/", "/fti/tick"))
    )
    assert numbers == list(range(len(numbers)))
