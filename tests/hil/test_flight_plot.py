"""``fti hil NAME --plot``: the picture shows what is flown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.hil.flight_plot import draw_flight
from tests.hil.worlds import world


def test_the_picture_shows_track_height_airspeed_and_bank() -> None:
    """Five seconds of an approach: the curves are those of the flight, the glide path is near it."""
    environment = world(5.0)
    state = environment.state(np.linspace(0.0, 5.0, 2000))
    panels = {panel.get_title(): panel for panel in draw_flight(environment).axes}
    heights = next(panel for title, panel in panels.items() if title.startswith("height above the ellipsoid; lowest"))
    assert np.allclose(heights.lines[0].get_ydata(), state.alt)
    assert np.nanmax(np.abs(np.asarray(heights.lines[1].get_ydata()) - state.alt)) < 10.0
    assert np.allclose(panels["bank, right wing down"].lines[0].get_ydata(), np.rad2deg(state.roll))
    east = np.asarray(panels["track"].lines[0].get_xdata())
    assert np.allclose(east * 1000.0, environment.terrain.frame.to_local(state.lat, state.lon, state.alt)[:, 0])
    airspeed = np.asarray(panels["calibrated airspeed"].lines[0].get_ydata())
    assert np.all(airspeed < state.tas)  # thinner air than at sea level
    assert airspeed == pytest.approx(state.tas, rel=0.06)


def test_the_command_draws_and_ends(tmp_path: Path) -> None:
    file = tmp_path / "flight.svg"
    assert main(["hil", "nominal", "--plot", str(file)]) == 0
    assert "Nominal approach" in file.read_text()


def test_a_picture_of_another_kind_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["hil", "nominal", "--plot", str(tmp_path / "flight.gif")])
    assert "must end with .png or .svg" in capsys.readouterr().err
