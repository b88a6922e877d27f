"""A gap in front of the chain: decoders start afresh, and every byte is still accounted for."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest

from fti import config as configuration
from fti.devices import bind_devices
from fti.drivers import deflection_pickups
from fti.drivers import freeflight_ra4500 as ra
from fti.messages.frames import ALL_SOURCES, RawFrame
from fti.messages.measurements import Measurement, RadioHeight, Stamp, SurfaceDeflection, TimeScale
from fti.messages.outputs import Event
from fti.service.navigation.decode_chain import GAP, Chain
from tests.drivers.test_deflection_pickups import FLAPS, RAW_FLAPS
from tests.service.slow_navigation import CONFIG

FRAME = ra.encode_height(30.0, (), ra.Options())
OTHER = ra.encode_height(90.0, (), ra.Options())
PICKUPS = """
[session]
name = "bus"
directory = "out"

[[link]]
name = "bus"
kind = "can"
interface = "socketcan"
channel = "can0"

[[device]]
name = "pickups"
link = "bus"
driver = "deflection_pickups"
options = { dbc_file = "raw.dbc", calibration_file = "flaps.csv" }
"""


def _chain() -> Chain:
    config = configuration.parse(tomllib.loads(CONFIG), CONFIG, Path("slow.toml"))
    return Chain(config, bind_devices(config, {}), None)


def _heights(chain: Chain, *reads: bytes) -> list[float | None]:
    fed = [chain.feed(RawFrame("line", seq, seq, data)) for seq, data in enumerate(reads)]
    measurements = [m for products in fed for _, m in products.measurements]
    return [round(m.height_agl) for m in measurements if isinstance(m, RadioHeight) and m.height_agl]


def test_two_halves_make_a_frame() -> None:
    assert _heights(_chain(), FRAME[:4], FRAME[4:]) == [30]
    assert _heights(_chain(), FRAME[:4], OTHER[4:]) == [12]  # this is what must not be


def test_halves_on_both_sides_of_a_gap_make_none() -> None:
    chain = _chain()
    assert _heights(chain, FRAME, FRAME[:4]) == [30]
    chain.reset_after_gap()
    assert _heights(chain, OTHER[4:], OTHER) == [90]


def test_bytes_and_messages_are_counted_on_across_a_gap() -> None:
    chain = _chain()
    _heights(chain, b"noise", FRAME, FRAME[:4])
    before = chain.device_decoders[0].decoder.counters.messages.copy()
    chain.reset_after_gap()
    chain.reset_after_gap()
    counters = chain.device_decoders[0].decoder.counters
    assert (counters.messages, counters.skipped[GAP], counters.held) == (before, 4, 0)
    _heights(chain, OTHER)
    assert counters.bytes_in == 5 + 2 * len(FRAME) + 4
    assert counters.bytes_in == counters.framed + counters.held + sum(counters.skipped.values())


def test_bytes_are_counted_on_when_a_decoder_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """A decoder must not fail; if one does, the ledger still adds up and the next frame is decoded."""
    chain = _chain()
    assert _heights(chain, FRAME) == [30]
    with monkeypatch.context() as patch:
        patch.setattr(chain.device_decoders[0].decoder, "_body", _fail)
        products = chain.feed(RawFrame("line", 1, 1, FRAME))
    assert [event.level for event in products.outputs if isinstance(event, Event)] == ["error"]
    assert _heights(chain, OTHER) == [90]
    counters = chain.device_decoders[0].decoder.counters
    assert counters.bytes_in == 3 * len(FRAME)
    assert counters.bytes_in == counters.framed + counters.held + sum(counters.skipped.values())


def _fail(*_: object) -> None:
    raise ZeroDivisionError


def test_the_table_that_a_node_has_acknowledged_outlasts_a_gap(tmp_path: Path) -> None:
    """The file has 10 degrees, the node was set to 12; the raw counts are converted with the setting of the node."""
    (tmp_path / "raw.dbc").write_text(RAW_FLAPS)
    (tmp_path / "flaps.csv").write_text(FLAPS)
    (tmp_path / "bus.toml").write_text(PICKUPS)
    config = configuration.load(tmp_path / "bus.toml")
    chain = Chain(config, bind_devices(config), None)
    nodes = deflection_pickups.make_encoder(deflection_pickups.Options(dbc=RAW_FLAPS, calibration=FLAPS))
    deflection = SurfaceDeflection(stamp=Stamp(0), surface="flaps", deflection=None, raw=1500)

    def fed(*frames: bytes) -> list[float]:
        measurements = [m for data in frames for _, m in chain.feed(RawFrame("bus", 0, 1, data)).measurements]
        return [round(math.degrees(m.deflection or 0.0), 6) for m in measurements if isinstance(m, SurfaceDeflection)]

    assert fed(*nodes.encode(deflection)) == [10.0]
    args = {"surface": "flaps", "raw": "1500", "deg": "12"}
    assert fed(*nodes.respond(deflection_pickups.command("insert_point", args))) == []
    chain.reset_after_gap()
    assert fed(*nodes.encode(deflection)) == [12.0]


@pytest.mark.parametrize(("readmitted", "states"), [(True, {"learning"}), (False, {"good", "away"})])
def test_a_device_that_boots_before_all_is_readmitted_is_not_held_to_its_old_clock(
    monkeypatch: pytest.MonkeyPatch, readmitted: bool, states: set[str]
) -> None:
    """Its time begins at zero again; what was known of it is discarded with the rest."""
    chain = _chain()

    def listened(begin_s: int, end_s: int, boot_s: int) -> set[str]:
        """States of its clock, 10 messages a second."""
        found = set[str]()
        for t_rx_ns in range(begin_s * 10**9, end_s * 10**9, 10**8):
            height = RadioHeight(stamp=Stamp(t_rx_ns, t_rx_ns - boot_s * 10**9, TimeScale.BOOT), height_agl=30.0)
            monkeypatch.setattr(chain.device_decoders[0].decoder, "feed", lambda *_, found=height: [found])
            chain.feed(RawFrame("line", 0, t_rx_ns, FRAME))
            found |= {clock.state for clock in chain.clocks_of("altimeter", t_rx_ns)}
        return found

    assert listened(begin_s=100, end_s=130, boot_s=0) == {"learning", "good"}
    if readmitted:
        chain.readmit(ALL_SOURCES, after_seq=0, t_ns=130 * 10**9)
    assert listened(begin_s=130, end_s=138, boot_s=130) == states


def test_a_measurement_that_fails_takes_nothing_from_the_others_of_its_message(monkeypatch: pytest.MonkeyPatch) -> None:
    """One read yields five: the second is refused by navigation, the fourth cannot even be stamped."""
    chain = _chain()
    fed: list[int] = []

    def feed(_: str, m: Measurement) -> list[Event]:
        fed.append(m.stamp.t_rx_ns)
        if m.stamp.t_rx_ns == 2:
            raise ZeroDivisionError
        return [Event(t_ns=m.stamp.t_rx_ns, level="info", source="pipeline", text="")]

    read = [RadioHeight(stamp=Stamp(k), height_agl=30.0) for k in range(1, 6)]
    monkeypatch.setattr(chain.device_decoders[0].decoder, "feed", lambda *_: [*read[:3], None, read[4]])
    monkeypatch.setattr(chain._pipeline, "feed", feed)
    products = chain.feed(RawFrame("line", 7, 9, FRAME))
    events = [event for event in products.outputs if isinstance(event, Event)]
    assert fed == [m.stamp.t_rx_ns for _, m in products.measurements] == [1, 2, 3, 5]
    assert [(event.level, event.t_ns) for event in events] == [
        ("info", 1), ("error", 9), ("info", 3), ("error", 9), ("info", 5)
    ]  # fmt: skip
    assert "failed at seq 7 and goes on: ZeroDivisionError" in events[1].text
