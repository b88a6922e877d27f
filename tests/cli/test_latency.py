"""fti latency: what was put into recorded outputs is found, and what is missing is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.cli.main import main
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.messages.outputs import HeightAboveGround
from tests.cli.sessions import SECOND, STARTED, make_folder, record_raw

RATE, LENGTH_S, LATE_S = 20, 150, 0.12


def recorded(tmp_path: Path, *, predicted: bool = True, late_s: float = LATE_S) -> Path:
    """A session with 150 s of a radar that is late, 0.3 m of noise, and of a laser that is not predicted."""
    folder = make_folder(tmp_path)
    record_raw(folder, range(10)).close()
    log = DerivedLog(folder, LogSettings(split_s=300, split_mb=100))
    rng = np.random.default_rng(1)
    t = np.arange(0, LENGTH_S, 1.0 / RATE)
    phases, periods = rng.uniform(0.0, 6.28, 12), rng.uniform(3.0, 20.0, 12)

    def should(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(150.0 + 4.0 * np.sin(2.0 * np.pi * at[:, None] / periods + phases).sum(axis=-1))

    measured = should(t - late_s) + 0.3 * rng.standard_normal(len(t))
    for at, raw, right in zip(t, measured, should(t), strict=True):
        t_ns = STARTED + round(at * SECOND)
        for sensor, expected in (("radar", float(right) if predicted else None), ("laser", None)):
            log.write_output(
                HeightAboveGround(
                    t_ns=t_ns, t_valid_ns=t_ns, sensor=sensor, raw=float(raw), height_agl=float(raw), sd=0.3,
                    valid=True, reasons=(), predicted=expected,
                )
            )  # fmt: skip
    log.close()
    return folder.path


def test_what_was_put_in_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = recorded(tmp_path)
    assert main(["latency", str(session), "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert set(table) == {"radar"}
    assert table["radar"]["latency"] == pytest.approx(LATE_S, abs=4.0 * table["radar"]["latency_sd"])
    assert table["radar"]["latency_sd"] < 0.005
    assert main(["latency", str(session)]) == 0
    assert "radar: +1" in capsys.readouterr().out


def test_what_cannot_be_estimated_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["latency", str(recorded(tmp_path, late_s=3.0))]) == 0
    assert "radar: cannot be estimated" in capsys.readouterr().out


def test_without_predictions_it_names_the_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["latency", str(recorded(tmp_path, predicted=False))]) == 2
    assert "[nav] terrain" in capsys.readouterr().err
