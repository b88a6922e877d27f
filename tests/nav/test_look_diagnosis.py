"""Which error of the sensor explains pairs that contradict the filter: errors of known size in exact geometry."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fti.arrays import Array
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.look_mark import SECOND_CLOCK, SECOND_MOUNTING, STATES, LookDrift
from fti.nav.look_diagnosis import LookDiagnosis
from tests.nav.test_look_mark import MODEL, Geometry, turn_of

#: Angular rate at the second look, and velocity at both: in a roll.
RATE_B, VEL_N = np.array([0.15, 0.0, 0.03]), np.array([170.0, 0.0, 0.0])
Error = Callable[[Geometry, int], Array]


def sharp(geometry: Geometry) -> Estimate:
    """A filter without errors that expects drifts to some centimetres."""
    truth = geometry.truth()
    P = truth.P.copy()
    column = MODEL.columns["look0.position_x"]
    P[:9, :9] = 0.0
    P[column : column + STATES, :] = P[:, column : column + STATES] = 0.0
    P[range(3), range(3)] = 0.05**2
    second = [MODEL.columns[name] for name in (*SECOND_MOUNTING, SECOND_CLOCK)]
    P[second, :] = P[:, second] = 0.0
    return Estimate(0, truth.y, P, truth.imu, MODEL)


def pair(seed: int, error: Error) -> tuple[LookDrift, Estimate]:
    """A pair whose looks see the ground with an error of the sensor; error : ray from the aircraft, in body axes."""
    rng = np.random.default_rng(seed)
    geometry = Geometry(rng)
    geometry.offsets[:], geometry.turns[:] = 0.0, 0.0
    geometry.mats[1] = geometry.mats[0] @ mat_from_rpy(0.15 + 0.02 * seed, 0.0, 0.05)
    geometry.marks = [
        replace(mark, x_e=x, mat_eb=mat) for mark, x, mat in zip(geometry.marks, geometry.x, geometry.mats, strict=True)
    ]
    seen = [geometry.x[look] + geometry.mats[look] @ error(geometry, look) for look in range(2)]
    away = geometry.ground - geometry.x[1]
    motion_e = np.cross(geometry.mats[1] @ RATE_B, away)
    measured = replace(geometry.measured(), drift=seen[1] - seen[0], motion_e=motion_e)
    return measured, sharp(geometry)


def true_ray(geometry: Geometry, look: int) -> Array:
    return np.asarray(geometry.mats[look].T @ (geometry.ground - geometry.x[look]))


def turned(vector: Array) -> Error:
    """Placed with a mounting that is turned by a vector [rad] against the true one."""
    return lambda geometry, look: turn_of(vector) @ true_ray(geometry, look)


def late(seconds: float) -> Error:
    """Measured before the stamp; the looks are level, and in a roll."""

    def ray(geometry: Geometry, look: int) -> Array:
        vel_e = geometry.start.mat_en @ VEL_N
        mat = geometry.mats[look] @ turn_of(-seconds * RATE_B * look)
        return np.asarray(mat.T @ (geometry.ground - geometry.x[look] + seconds * vel_e))

    return ray


def cause(error: Error, *, has_second_scanner: bool = False) -> str:
    diagnosis = LookDiagnosis(2, has_second_scanner=has_second_scanner)
    for seed in range(2):
        diagnosis.feed(*pair(seed, error))
    return diagnosis.cause()


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (late(0.05), "its scans are stamped 50 ms too late (latency_ms)"),
        (late(-0.08), "its scans are stamped 80 ms too early (latency_ms)"),
        (turned(np.radians([0.0, 0.0, 1.5])), "rpy_bs_deg turns it 1.5 deg too far to the right"),
        (turned(np.radians([0.0, -1.0, 0.0])), "rpy_bs_deg turns it 1.0 deg too far front down"),
        (lambda geometry, look: 1.02 * true_ray(geometry, look), "its ranges are 2.0 % too long"),
    ],
)
def test_an_error_is_named_with_its_size(error: Error, text: str) -> None:
    """To 2 ms, and to 0.1 deg: the effects are those of the poses as they are placed."""
    found = cause(error)
    number = re.compile(r"\d+(\.\d+)?")
    assert number.sub("", found) == number.sub("", text)
    assert [float(each[0]) for each in number.finditer(found)] == pytest.approx(
        [float(each[0]) for each in number.finditer(text)], abs=2.0 if "ms" in text else 0.1
    )


@pytest.mark.parametrize(("axis", "words"), [(0, "right side down"), (1, "front up"), (2, "to the right")])
def test_a_wrong_mounting_of_the_rear_scanner_is_named(axis: int, words: str) -> None:
    """Only the later look is turned; with one scanner no such error is named."""
    error = turned(np.radians(1.5) * np.eye(3)[axis])

    def of_rear(geometry: Geometry, look: int) -> Array:
        return error(geometry, look) if look else true_ray(geometry, look)

    named = re.fullmatch(
        r"the rear one is turned (\d\.\d) deg too far (.*) by rpy_bs_deg, .*", cause(of_rear, has_second_scanner=True)
    )
    assert named and named[2] == words
    assert float(named[1]) == pytest.approx(1.5, abs=0.1)
    assert "rear" not in cause(of_rear)


def test_two_errors_and_no_error_are_not_named() -> None:
    def both(geometry: Geometry, look: int) -> Array:
        return np.asarray(turn_of(np.radians([0.0, 0.0, 2.0])) @ late(0.1)(geometry, look))

    assert cause(both) == ""
    assert cause(true_ray) == ""
    assert LookDiagnosis(2).cause() == ""
