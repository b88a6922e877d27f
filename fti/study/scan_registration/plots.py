"""Pictures of the registration of two looks (source 003, fig. 5.5, 5.6, 5.10, 7.37, 7.38; local planes, triangles)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.nav.scan_matching.look import Look
from fti.nav.scan_matching.plane_lattice import UP, fit_planes, frame_around, surfaces_at
from fti.nav.scan_matching.registration import STEP, point_distance
from fti.nav.scan_matching.triangulation import TriangulatedLook
from fti.plot_style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.scanner import RangeScanner, time_to_overlap
from fti.study.scan_registration.looks import (
    HEIGHT_AGL_M,
    INTERVAL_S,
    SPEED_MPS,
    LookPair,
    draw_pair,
    make_ground,
)

#: Heights above ground and speeds of the pictures of the source [m, m/s].
HEIGHTS_M = {100.0: BLUE, 200.0: GREEN, 300.0: ORANGE, 500.0: VERMILION}
SPEEDS = np.linspace(20.0, 250.0, 200)
#: Field of view of fig. 5.5 and 5.10, and the mounting of the scanner of fig. 5.6 that looks ahead [rad].
FIELD_OF_VIEW, AHEAD = math.radians(80.0), math.radians(20.0)
#: A profile through a look: length and distance of its places [m].
PROFILE_M, PROFILE_STEP_M = 120.0, 0.25


def _figure(title: str, subtitle: str, height: float = 4.6) -> Figure:
    return new_figure(title, subtitle, width=9.0, height=height)


def line_rate() -> Figure:
    """Lines per second for equal distances of points and lines (eq. 5.5, fig. 5.5)."""
    figure = _figure(
        "Lines per second that make a squared grid", "Scanner of 10 kHz and 80 deg without dead time, looking down"
    )
    axes = figure.subplots()
    scanner = RangeScanner(Laser(1000.0), pulse_rate=10_000.0, field_of_view=FIELD_OF_VIEW, facets=9)
    for height, colour in HEIGHTS_M.items():
        axes.plot(SPEEDS, scanner.square_line_rate(height, SPEEDS), color=colour, label=f"{height:g} m above ground")
    label_axes(axes, "speed over ground [m/s]", "lines per second")
    add_legend(axes)
    return figure


def time_to_overlap_figure() -> Figure:
    """Time from the line of one scanner to that of the other one (fig. 5.6)."""
    figure = _figure("Time to overlap of two scanners", "One looks 20 deg ahead, the other one down; level ground")
    axes = figure.subplots()
    for height, colour in HEIGHTS_M.items():
        axes.plot(
            SPEEDS, time_to_overlap(height, SPEEDS, (AHEAD, 0.0)), color=colour, label=f"{height:g} m above ground"
        )
    label_axes(axes, "speed over ground [m/s]", "time to overlap [s]")
    add_legend(axes)
    return figure


def image_rate() -> Figure:
    """Longest interval and lowest rate of images that overlap by half (eq. 5.6, fig. 5.10)."""
    figure = _figure("Images that overlap by half", "Field of view of 80 deg along the track, level ground")
    interval, rate = figure.subplots(1, 2)
    imager = RangeImager(field_of_view=(FIELD_OF_VIEW, FIELD_OF_VIEW))
    for height, colour in HEIGHTS_M.items():
        longest = imager.overlap_interval(height, SPEEDS)
        interval.plot(SPEEDS, longest, color=colour, label=f"{height:g} m above ground")
        rate.plot(SPEEDS, 1.0 / longest, color=colour)
    label_axes(interval, "speed over ground [m/s]", "longest interval [s]")
    label_axes(rate, "speed over ground [m/s]", "lowest rate [Hz]")
    add_legend(interval)
    return figure


def pair_choice() -> Figure:
    """Overlap, and overlap times interval (fig. 7.37)."""
    imager, intervals = RangeImager(), np.linspace(0.0, 2.2, 221)
    figure = _figure(
        "The pair with the largest overlap times interval",
        f"{HEIGHT_AGL_M:g} m, {SPEED_MPS:g} m/s, 60 deg; dots: pairs of images at 2 Hz; dashed: L / 2v",
        height=5.5,
    )
    images = np.arange(1.0, 5.0) / imager.frame_rate
    for axes, power, label in zip(
        figure.subplots(2, 1), (0, 1), ("overlap [m²]", "overlap x interval [m² s]"), strict=True
    ):
        for times, style in ((intervals, "-"), (images, "o")):
            axes.plot(times, times**power * imager.overlap_area(HEIGHT_AGL_M, SPEED_MPS, times), style, color=BLUE)
        axes.axvline(float(imager.overlap_interval(HEIGHT_AGL_M, SPEED_MPS)), color=GREY, linestyle="--")
        label_axes(axes, "interval [s]", label)
    return figure


def _example(seed: int) -> LookPair:
    return draw_pair(make_ground("rough", seed), np.random.default_rng([seed, 26]))


def sampling(seed: int) -> Figure:
    """The points of both looks of a pair over rough ground (fig. 7.38)."""
    pair = _example(seed)
    figure = _figure(
        "Two looks at the same ground",
        f"75 x 75 points each, {INTERVAL_S:g} s apart; edges: around all points of a look. Colour: height [m]",
        height=6.5,
    )
    axes = figure.subplots()
    for look, colour in ((pair.first, BLUE), (pair.second, VERMILION)):
        east, north, up = (look.points_l - pair.centre_l).T
        points = axes.scatter(east, north, c=up, s=3)
        _draw_edge(axes, look, pair.centre_l, colour)
    figure.colorbar(points, ax=axes, label="height above the centre [m]")
    axes.set_aspect("equal")
    label_axes(axes, "east [m]", "north [m]")
    add_legend(axes)
    return figure


def _draw_edge(axes: Axes, look: Look, centre: Array, colour: str) -> None:
    count = math.isqrt(len(look))
    if count * count != len(look):  # a pixel without return: the edge is not known by its number
        return
    number = np.arange(count * count).reshape(count, count)
    edge = np.concatenate((number[0], number[:, -1], number[-1, ::-1], number[::-1, 0]))
    label = "first look" if colour == BLUE else "second look"
    axes.plot(*(look.points_l - centre)[edge, :2].T, color=colour, label=label)


def surfaces(seed: int) -> Figure:
    """A profile through a look: ground, local planes, triangles."""
    pair = _example(seed)
    look, step = pair.first, STEP * point_distance(pair.first.points_l)
    frame = frame_around((look,), step)
    along = np.arange(0.0, PROFILE_M, PROFILE_STEP_M)
    places = look.points_l[:, :2].mean(axis=0) + along[:, None] * [1.0, 0.0]
    corner = np.array([frame.east0, frame.north0])
    planes = surfaces_at(fit_planes(look, frame), corner, step, np.column_stack((places, np.zeros(len(places)))))[:, UP]
    figure = _figure("The surface of a look", f"Rough ground, points {step / STEP:.1f} m apart, ranges to 0.1 m")
    axes = figure.subplots()
    axes.plot(along, make_ground("rough", seed).up(*places.T), color=GREY, linewidth=3.0, label="ground")
    axes.plot(along, TriangulatedLook(look).at(places)[0], color=BLACK, linewidth=0.9, label="triangles")
    axes.plot(along, planes, color=VERMILION, label="local planes")
    label_axes(axes, "east [m]", "height [m]")
    add_legend(axes)
    return figure
