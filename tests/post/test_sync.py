"""``fti sync`` over a session that is written here: a receiver that drifts and is set, a computer that is set."""

from __future__ import annotations

import csv
import hashlib
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from fti.cli.main import main
from fti.drivers import nmea0183
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.measurements import DeviceTime, Stamp, TimeScale
from fti.post.reprocess import recorded_setup, reprocess
from tests.small_config import LINE, device
from tests.web.chromium import Chromium

CONFIG = LINE + device("receiver", "nmea0183", latency_ms=60)
SECOND_NS = 1_000_000_000
MS = 1_000_000
FTI_0 = 1_700_000_000 * SECOND_NS
DRIFT_PPM = 50.0
LENGTH_S, STEP_S = 300, 200
LATENCY_NS = 60 * MS
BOOKED_NS = 5 * SECOND_NS  # the receiver's clock is so far ahead
SET_NS = -1 * SECOND_NS  # and goes back by this at STEP_S
REAL_SET_S, REAL_SET_NS = 100, 3_200 * MS


def shown_ns(t_ns: int) -> int:
    """What the receiver's clock shows at an FTI time."""
    since = t_ns - FTI_0
    return FTI_0 + BOOKED_NS + round(since * (1 + DRIFT_PPM * 1e-6)) + (SET_NS if since >= STEP_S * SECOND_NS else 0)


def record(folder: Path, attachments: dict[str, str], *, times: bool = True, mode: str = "continuous") -> Path:
    """A sentence for each whole second of the receiver; one in ten comes 80 ms late."""
    session = SessionFolder.create(folder, "small", FTI_0)
    texts = [(name, "text/plain", text.encode()) for name, text in attachments.items()]
    log = RawLog(
        session,
        [RawTopic("line", "serial", {})],
        LogSettings(split_s=1000, split_mb=10, attachments=texts, metadata={"fti": {"mode": mode}}),
    )
    encoder = nmea0183.make_encoder(nmea0183.Options())
    rng = np.random.default_rng(1)
    for k in range(LENGTH_S):
        second_ns = FTI_0 + (k + 1) * SECOND_NS + BOOKED_NS  # of the receiver
        back_ns = SET_NS if k >= STEP_S else 0
        true_ns = FTI_0 + round((k + 1) * SECOND_NS / (1 + DRIFT_PPM * 1e-6))
        late_ns = 80 * MS if k % 10 == 9 else round(abs(rng.normal(0.0, 0.3)) * MS)
        t_rx_ns = true_ns + LATENCY_NS + late_ns
        device_time = DeviceTime(stamp=Stamp(t_rx_ns, second_ns + back_ns, TimeScale.UTC))
        log.write_frame("line", 2 * k, t_rx_ns, b"".join(encoder.encode(device_time)) if times else b"$no time\r\n")
        log.write_tick(2 * k + 1, t_rx_ns)
        clock_ns = FTI_0 + k * SECOND_NS
        realtime_ns = clock_ns + (REAL_SET_NS if k >= REAL_SET_S else 0)
        note = {"t_ns": clock_ns, "monotonic_ns": clock_ns - FTI_0, "monotonic_raw_ns": k * 1_000_002_000}
        log.write_json("/fti/clock", clock_ns, {**note, "realtime_ns": realtime_ns, "width_ns": 1000})
    log.close()
    return session.path


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return record(tmp_path, {"config.toml": CONFIG})


def sync(session: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main(["sync", str(session), "--json", *arguments]) == 0
    table: dict[str, Any] = json.loads(capsys.readouterr().out)
    return table


def test_drift_step_and_late_messages_are_found(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = sync(session, capsys)
    (device,) = table["devices"]
    assert (device["device"], device["scale"], device["messages"]) == ("receiver", "utc", LENGTH_S)
    before, after = device["segments"]
    for segment in (before, after):
        assert abs(segment["drift_ppm"] - DRIFT_PPM) <= segment["drift_95_ppm"]
        assert segment["drift_95_ppm"] < 5.0
        assert segment["delay_ms"]["max"] == pytest.approx(80.0, abs=1.0)
        error_ms = (segment["offset_ns"] + segment["first_ns"] - shown_ns(segment["first_ns"])) / MS
        assert abs(error_ms) < 1.0
    assert before["late"] == 20
    assert after["first_ns"] - FTI_0 == pytest.approx((STEP_S + 1) * SECOND_NS, abs=SECOND_NS)
    assert (after["offset_ns"] - before["offset_end_ns"]) / SECOND_NS == pytest.approx(-1.0, abs=0.001)


def test_the_computers_clock_and_gnss_time_stand_beside_it(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = sync(session, capsys)
    assert table["computer"]["steps"] == [{"t_ns": FTI_0 + REAL_SET_S * SECOND_NS, "by_ns": REAL_SET_NS}]
    assert table["computer"]["monotonic_against_oscillator_ppm"] == pytest.approx(-2.0, abs=0.01)
    assert table["gnss"]["device"] == "receiver"
    assert table["gnss"]["fti_drift_ms_per_hour"] == pytest.approx(-180.0, abs=10.0)


def test_a_person_reads_the_same(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sync", str(session)]) == 0
    text = capsys.readouterr().out
    assert "receiver  utc time, 300 messages" in text
    assert "2 segments" in text
    assert "drift +50." in text or "drift +49." in text
    assert "set by +3.200000 s" in text
    assert "FTI against GNSS  -" in text


def test_the_time_base_maps_any_time_and_leaves_the_recording_alone(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = _digests(session)
    out = tmp_path / "base.csv"
    sync(session, capsys, "--out", str(out))
    assert _digests(session) == before
    with out.open() as file:
        rows = list(csv.DictReader(file))
    receiver = [row for row in rows if row["device"] == "receiver"]
    assert {row["segment"] for row in receiver} == {"0", "1"}
    for a, b in pairwise(receiver):
        if a["segment"] == b["segment"]:
            middle_ns = (int(a["t_fti_ns"]) + int(b["t_fti_ns"])) // 2
            joined_ns = (int(a["clock_ns"]) + int(b["clock_ns"])) // 2
            assert abs(joined_ns - shown_ns(middle_ns)) < 1 * MS
    computer = [row for row in rows if row["device"] == "computer"]
    assert [int(row["clock_ns"]) - int(row["t_fti_ns"]) for row in computer] == [0, 0, REAL_SET_NS, REAL_SET_NS]


def test_the_time_base_as_mcap_has_the_same_rows(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sync(session, capsys, "--out", str(tmp_path / "base.csv"))
    sync(session, capsys, "--out", str(tmp_path / "base.mcap"))
    with (tmp_path / "base.mcap").open("rb") as file:
        contents = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages("/fti/time_base")]
    with (tmp_path / "base.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert sorted(map(_key, contents)) == sorted(map(_key, rows))


def _key(row: dict[str, Any]) -> tuple[str, ...]:
    return tuple(str(value) for value in row.values())


def _digests(session: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in session.iterdir()}


def test_nothing_is_overwritten_and_other_names_are_refused(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "base.csv").write_text("mine")
    (tmp_path / "page.html").write_text("mine")
    for name in ("base.csv", "base.txt"):
        assert main(["sync", str(session), "--out", str(tmp_path / name)]) == 2
        assert name in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["sync", str(session), "--plot", str(tmp_path / "page.html")])
    assert "page.html: already exists" in capsys.readouterr().err
    assert (tmp_path / "base.csv").read_text() == (tmp_path / "page.html").read_text() == "mine"


def test_what_is_made_of_a_snapshot_reports_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = record(tmp_path, {"config.toml": CONFIG}, mode="snapshot")
    note = "SNAPSHOT: not a continuous recording"
    table = sync(session, capsys, "--out", str(tmp_path / "base.csv"), "--plot", str(tmp_path / "page.html"))
    assert table["session"]["note"].startswith(note)
    assert note in (tmp_path / "page.html").read_text()
    assert json.loads((tmp_path / "base.json").read_text()) == table["session"]
    assert main(["sync", str(session), "--out", str(tmp_path / "base.mcap")]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith(f"*** {note}") and printed.err == ""
    with (tmp_path / "base.mcap").open("rb") as file:
        (metadata,) = make_reader(file).iter_metadata()
    assert metadata.metadata == table["session"]


def test_a_continuous_session_has_no_such_note(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "note" not in sync(session, capsys, "--out", str(tmp_path / "base.csv"))["session"]
    assert json.loads((tmp_path / "base.json").read_text())["session"] == session.name
    assert main(["sync", str(session), "--out", str(tmp_path / "base.csv")]) == 2  # before anything is decoded
    assert "base.csv: already exists" in capsys.readouterr().err
    assert main(["sync", str(session), "--out", str(tmp_path / "none" / "base.csv")]) == 2
    assert f"no folder {tmp_path / 'none'}" in capsys.readouterr().err
    assert main(["sync", str(session)]) == 0
    assert "SNAPSHOT" not in capsys.readouterr().out


def test_a_session_without_device_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = record(tmp_path, {"config.toml": CONFIG}, times=False)
    table = sync(session, capsys, "--out", str(tmp_path / "base.csv"), "--plot", str(tmp_path / "page.html"))
    assert table["devices"] == []
    assert table["gnss"] is None
    assert main(["sync", str(session)]) == 0
    assert "no device of this session sends its own time" in capsys.readouterr().out


def test_navigation_learned_the_same_clock(session: Path, tmp_path: Path) -> None:
    """Reprocessed: late messages have the time at which they were true, and the clock is told once a second."""
    recording = Recording.open(session)
    setup = recorded_setup(recording, session)
    folders = [
        reprocess(recording, setup, tmp_path / out, as_flown=False, progress=lambda seq: None) for out in ("a", "b")
    ]
    first, second = (list(Recording.open(folder).messages()) for folder in folders)
    assert first == second
    stamps = [json.loads(data)["stamp"] for topic, *_, data in first if topic == "/receiver/device_time"]
    ages_ms = [(stamp["t_rx_ns"] - stamp["t_valid_ns"]) / MS for stamp in stamps]
    assert ages_ms[:9] == [60.0] * 9  # not known yet: the arrival counts
    assert ages_ms[59:200:10] == pytest.approx([140.0] * 15, abs=1.0)
    notes = [json.loads(data) for topic, *_, data in first if topic == "/fti/device_clock"]
    assert len(notes) > 280
    known = [note["clocks"]["receiver_utc"] for note in notes if note["t_ns"] < FTI_0 + STEP_S * SECOND_NS][-1]
    assert (known["state"], known["late"]) == ("good", pytest.approx(17, abs=3))
    assert known["drift_ppm"] == pytest.approx(DRIFT_PPM, abs=4 * known["drift_sd_ppm"])
    device_time = [json.loads(data)["message"] for topic, *_, data in first if topic == "/fti/event"]
    assert any("receiver (utc) stepped by -1.0" in text for text in device_time)


@pytest.mark.browser
async def test_the_page_draws_every_clock_and_loads_nothing(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page_file = tmp_path / "page.html"
    sync(session, capsys, "--plot", str(page_file))
    async with Chromium() as browser:
        page = await browser.open(page_file.as_uri())
        await page.wait_for("document.querySelectorAll('.uplot canvas').length === 3")
        assert "receiver" in await page.eval("document.body.innerText")
        assert page.requests == [page_file.as_uri()]
        assert page.problems == []
