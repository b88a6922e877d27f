"""Rows of measurements without JSON between."""

from __future__ import annotations

import json
import math

from fti.logger.export.columns import Type
from fti.logger.export.measurement_rows import MeasurementRows
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    ImuSample,
    Measurement,
    Satellite,
    Satellites,
    Stamp,
    SurfaceDeflection,
    TimeScale,
)

STAMP = Stamp(5, 7, TimeScale.GPS, 4)


def row(topic: str, measurement: Measurement) -> dict[str, object]:
    rows = MeasurementRows(topic, type(measurement))
    return dict(zip([column.name for column in rows.columns], rows.cells(measurement), strict=True))


def test_a_number_that_is_not_finite_is_unknown() -> None:
    found = row("/ins/attitude", Attitude(stamp=STAMP, roll=math.nan, pitch=-math.inf, heading=2))
    assert (found["roll"], found["pitch"], found["heading"]) == (None, None, 2.0)
    assert isinstance(found["heading"], float)
    assert [found[f"stamp.{name}"] for name in ("t_rx_ns", "t_dev_ns", "time_scale", "t_valid_ns")] == [5, 7, "gps", 4]


def test_a_vector_has_a_column_for_each_component_also_where_it_is_unknown() -> None:
    found = row("/imu/imu_sample", ImuSample(stamp=STAMP, gyro_b=(1.0, 2.0, math.nan)))
    assert [found[f"accel_b.{n}"] for n in range(3)] == [None, None, None]
    assert [found[f"gyro_b.{n}"] for n in range(3)] == [1.0, 2.0, None]


def test_a_list_of_messages_is_json_and_one_of_texts_is_a_list() -> None:
    satellites = (Satellite(system="G", number=3, azimuth=1.5), Satellite(system="E", number=4, elevation=math.nan))
    found = row("/gnss/satellites", Satellites(stamp=STAMP, satellites=satellites, used=2))
    parsed = json.loads(str(found["satellites"]))
    assert [(s["number"], s["azimuth"], s["elevation"]) for s in parsed] == [(3, 1.5, None), (4, None, None)]
    flags = row("/ins/device_status", DeviceStatus(stamp=STAMP, ok=False, flags=("hot", "old")))["flags"]
    assert list(flags if isinstance(flags, tuple) else ()) == ["hot", "old"]


def test_columns_have_the_types_of_the_class() -> None:
    columns = {
        column.name: (column.type, column.unit)
        for column in MeasurementRows("/tail/surface_deflection", SurfaceDeflection).columns
    }
    assert columns["raw"] == (Type.INT, "1") and columns["deflection"] == (Type.FLOAT, "rad")
    assert columns["surface"] == (Type.TEXT, None) and columns["valid"] == (Type.BOOL, None)
