"""Satellites by broadcast ephemerides against rtklib, on what a real receiver received.

``convbin -r nov -tr 2008/5/26 0:0:0 novatel_oemv_part1.gps`` (RINEX) and ``rnx2rtkp -x 4 -p 0 -sys G`` (its trace)
printed the numbers, with rtklib 2.4.3: first epoch of the capture, times of transmission, places, clocks without TGD.
"""

from __future__ import annotations

import numpy as np
import pytest

from fti.drivers import novatel_oem6 as novatel
from fti.geodesy.broadcast_orbit import clock_offset, position_e, rotate_with_earth, seconds_after, transmission_time
from fti.messages.measurements import Ephemeris, Pseudoranges
from tests.helpers import ROOT

#: Number: time of transmission after 23:06:59 [s], place [m], clock [ns].
RTKLIB = {
    3: (0.932084, (-13911594.751, 7661801.693, 20917969.926), 489803.552),
    6: (0.929291, (-15470875.125, 3659783.613, 21457283.971), 263436.798),
    7: (0.927035, (424024.213, 18012848.774, 19452331.008), 5765.424),
    8: (0.917523, (11730165.190, 9025200.950, 22069560.351), 1083.113),
    11: (0.921125, (-8882897.208, 23885461.380, -7046042.870), -34964.265),
    13: (0.918337, (5546230.100, 25919563.413, 1431634.062), 306580.532),
    16: (0.925006, (-25156746.385, -1720177.877, 8789540.859), -20903.046),
    19: (0.931885, (-9954633.030, 16861724.006, 17849770.147), -4681.209),
    22: (0.917512, (-22765978.521, -12300275.551, 6325503.318), 183707.278),
}
SECOND_OF_WEEK = 515_219.0  # Friday 2009-12-18, 23:06:59


def test_places_and_clocks_are_those_of_rtklib() -> None:
    """Within 2 mm and 2 ps; the seconds of transmission are printed to a microsecond."""
    capture = (ROOT / "tests/captures/novatel_oemv_part1.gps").read_bytes()
    measurements = novatel.make_decoder(novatel.Options()).feed(capture, 1)
    known = {m.number: m for m in measurements if isinstance(m, Ephemeris)}
    epoch = next(m for m in measurements if isinstance(m, Pseudoranges))
    ranges = {o.number: o.pseudorange for o in epoch.observations if (o.system, o.signal) == ("gps", "L1C")}
    assert known.keys() == ranges.keys() == RTKLIB.keys()
    for number, (second, place, clock_ns) in RTKLIB.items():
        m, pseudorange = known[number], ranges[number]
        assert pseudorange is not None
        t = transmission_time(m, SECOND_OF_WEEK + 1.0, pseudorange)
        assert t - SECOND_OF_WEEK == pytest.approx(second, abs=6e-7)
        assert position_e(m, t) == pytest.approx(place, abs=2e-3)
        assert (clock_offset(m, t) + m.tgd) * 1e9 == pytest.approx(clock_ns, abs=2e-3)


def test_the_group_delay_is_taken_off_the_clock() -> None:
    """IS-GPS-200, 20.3.3.3.3.2: a receiver of L1 alone subtracts TGD."""
    capture = (ROOT / "tests/captures/novatel_oemv_part1.gps").read_bytes()
    m = next(m for m in novatel.make_decoder(novatel.Options()).feed(capture, 1) if isinstance(m, Ephemeris))
    assert m.tgd == pytest.approx(-0.116415321827e-7, rel=1e-9)  # satellite 11, by rtklib
    polynomial = m.af0 + m.af1 * (m.toc - m.toc)
    assert abs(clock_offset(m, m.toc) - (polynomial - m.tgd)) < 2.4e-8  # relativity, at an eccentricity of 0.01


def test_time_differences_cross_the_end_of_a_week() -> None:
    assert seconds_after(100.0, 604_700.0) == pytest.approx(200.0)
    assert seconds_after(604_700.0, 100.0) == pytest.approx(-200.0)


def test_the_earth_turns_eastward_under_the_light() -> None:
    """In 0.07 s a point at 26 560 km falls back by 136 m to the west: 7.292e-5 rad/s."""
    values = rotate_with_earth(np.array([26_560_000.0, 0.0, 1.0]), 0.07)
    assert values == pytest.approx([26_560_000.0, -135.57, 1.0], abs=0.01)
