"""The guard: a failure is reported and only its unit starts again."""

import asyncio

import pytest

from fti.service import fault_guard


def test_a_failure_is_reported_and_goes_no_further() -> None:
    reports: list[tuple[str, str]] = []
    with fault_guard.catch_failures("unit", lambda unit, error: reports.append((unit, str(error)))):
        raise ValueError("sick")
    assert reports == [("unit", "sick")]


def test_interrupts_pass() -> None:
    with pytest.raises(KeyboardInterrupt), fault_guard.catch_failures("unit", lambda unit, error: None):
        raise KeyboardInterrupt


class PanicException(BaseException):
    """As pyo3 raises when Rust panics: no Exception."""


def test_a_panic_is_a_failure_like_any_other() -> None:
    reports: list[str] = []
    with fault_guard.catch_failures("unit", lambda unit, error: reports.append(f"{type(error).__name__}: {error}")):
        raise PanicException("assertion failed: secs <= MAX_NB_SEC")
    assert reports == ["Panic: PanicException: assertion failed: secs <= MAX_NB_SEC"]


@pytest.mark.parametrize(
    "ending", [SystemExit(), GeneratorExit(), asyncio.CancelledError(), BaseExceptionGroup("", [KeyboardInterrupt()])]
)
def test_other_endings_pass(ending: BaseException) -> None:
    with pytest.raises(type(ending)), fault_guard.catch_failures("unit", lambda unit, error: None):
        raise ending


async def test_a_unit_runs_again_until_it_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fault_guard, "FIRST_DELAY_S", 0.001)
    tries: list[int] = []

    async def unit() -> None:
        tries.append(len(tries))
        if len(tries) < 4:
            raise RuntimeError("not yet")

    reports: list[str] = []
    await fault_guard.keep_running("unit", unit, lambda name, error: reports.append(name))
    assert tries == [0, 1, 2, 3]
    assert reports == ["unit"] * 3


async def test_cancelling_ends_it() -> None:
    async def unit() -> None:
        await asyncio.Event().wait()

    task = asyncio.create_task(fault_guard.keep_running("unit", unit, lambda name, error: None))
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
