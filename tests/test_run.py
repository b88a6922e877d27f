"""The runner of all tests runs a few that failed beside others again, and hides none that fails alone."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from tests.run import MAX_RETRIES, Part, run_part, share_out

#: It fails as often as its file of marks says.
TEST = """
    from pathlib import Path
    import pytest

    @pytest.mark.parametrize("n", range({count}))
    def test_it(n: int) -> None:
        left = Path("{folder}", str(n))
        fails = int(left.read_text())
        left.write_text(str(fails - 1))
        assert fails <= 0
"""


@pytest.fixture(autouse=True)
def _no_options_of_this_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the project are unknown to tests in another folder."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)


@pytest.mark.parametrize(
    ("fails", "code"),
    [
        ([0, 0], 0),
        ([0, 1], 0),
        ([1] * MAX_RETRIES, 0),
        ([0, 2], 1),
        ([1] * (MAX_RETRIES + 1), 1),
    ],
)
def test_a_few_that_failed_are_run_again_once(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], fails: list[int], code: int
) -> None:
    for n, times in enumerate(fails):
        (tmp_path / str(n)).write_text(str(times))
    file = tmp_path / "test_it.py"
    file.write_text(textwrap.dedent(TEST.format(count=len(fails), folder=tmp_path)))
    assert run_part(Part("quick tests", (str(file),))) == code
    output = capfd.readouterr().out
    passed_alone = code == 0 and any(fails)
    assert ("these failed beside others and passed alone" in output) is passed_alone
    if passed_alone:
        assert all(f"test_it[{n}]" in output for n, times in enumerate(fails) if times)


def test_an_error_that_is_no_failure_is_not_run_again(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_part(Part("quick tests", (str(tmp_path / "missing.py"),))) not in {0, 1}
    assert capfd.readouterr().out.count("== quick tests: 1 files") == 1


def test_the_longest_files_are_shared_out_first(monkeypatch: pytest.MonkeyPatch) -> None:
    times = {"long.py": 50.0, "a.py": 20.0, "b.py": 20.0, "c.py": 15.0}
    monkeypatch.setattr("tests.progress.known_times", lambda: times)
    assert share_out(sorted(times), 2) == [["long.py"], ["a.py", "b.py", "c.py"]]
    assert share_out(["new.py"], 4) == [["new.py"]]
