"""A flight computer of somebody else: an autopilot and a satellite receiver in, position, height and glide path out.

It knows nothing of fti.  ``--bias alt=20`` makes one of its outputs wrong, for a test that must fail then.
"""

import argparse
import math
import os
import selectors
import socket
import time

import serial
from pymavlink.dialects.v20 import common as mavlink

METRES_PER_DEGREE = 111_132.0
GLIDE, COURSE = math.tan(math.radians(3.0)), math.radians(275.0)
THRESHOLD_LAT, THRESHOLD_LON, THRESHOLD_ALT, CROSSING_HEIGHT = 36.63, -84.1675, 360.0, 15.24
EARTH_RADIUS, PERIOD_S, MAX_AGE_S, GNSS_LATENCY_S = 6_371_000.0, 0.1, 0.3, 0.06
SHARE_OF_GNSS = 0.05


class FlightComputer:
    def __init__(self, bias):
        self.bias, self.start_s = bias, time.monotonic()
        self.mavlink = mavlink.MAVLink(None, srcSystem=42)
        self.heard = {}  # name of a message -> (when it came, the message)
        self.offset = [0.0, 0.0]  # of the receiver from the autopilot: north, east [m]

    def position(self, now_s):
        """Latitude, longitude [deg], altitude [m] of the autopilot, carried on by its velocity."""
        t_s, m = self.heard["GLOBAL_POSITION_INT"]
        after_s, lat = now_s - t_s, m.lat / 1e7
        lon_metres = METRES_PER_DEGREE * 1.0018 * math.cos(math.radians(lat))
        north, east, down = (v / 100 * after_s for v in (m.vx, m.vy, m.vz))
        return lat + north / METRES_PER_DEGREE, m.lon / 1e7 + east / lon_metres, m.alt / 1000 - down, lon_metres

    def take_gga(self, line, now_s):
        """Draw the offset of the position towards what the receiver says."""
        fields = line.split(",")
        if not fields[0].endswith("GGA") or fields[6] in ("", "0") or "GLOBAL_POSITION_INT" not in self.heard:
            return
        lat, lon = (float(f[:i]) + float(f[i:]) / 60 for f, i in ((fields[2], 2), (fields[4], 3)))
        lat, lon = math.copysign(lat, fields[3] == "N" or -1), math.copysign(lon, fields[5] == "E" or -1)
        own_lat, own_lon, _, lon_metres = self.position(now_s - GNSS_LATENCY_S)
        found = (lat - own_lat) * METRES_PER_DEGREE, (lon - own_lon) * lon_metres
        self.offset = [old + SHARE_OF_GNSS * (new - old) for old, new in zip(self.offset, found, strict=True)]

    def results(self, now_s):
        """The messages that are due; none before the sensors have been heard."""
        if not {"GLOBAL_POSITION_INT", "ATTITUDE", "DISTANCE_SENSOR"} <= set(self.heard):
            return
        b = lambda name, value: value + self.bias.get(name, 0.0)  # noqa: E731
        boot_ms = round((now_s - self.start_s) * 1000)
        lat, lon, alt, lon_metres = self.position(now_s)
        north, east = b("north", self.offset[0]), b("east", self.offset[1])
        m, a = self.heard["GLOBAL_POSITION_INT"][1], self.heard["ATTITUDE"][1]
        out_lat, out_lon = lat + north / METRES_PER_DEGREE, lon + east / lon_metres
        speeds = [round(b(f"vel_{axis}", v / 100) * 100) for axis, v in (("n", m.vx), ("e", m.vy), ("d", m.vz))]
        place = round(out_lat * 1e7), round(out_lon * 1e7), round(b("alt", alt) * 1000)
        yield mavlink.MAVLink_global_position_int_message(boot_ms, *place, 0, *speeds, 65535)
        angles = [b(name, value) for name, value in (("roll", a.roll), ("pitch", a.pitch), ("heading", a.yaw))]
        yield mavlink.MAVLink_attitude_message(boot_ms, *angles, a.rollspeed, a.pitchspeed, a.yawspeed)
        range_s, d = self.heard["DISTANCE_SENSOR"]
        seen = d.signal_quality != 1 and now_s - range_s < MAX_AGE_S
        height = b("height", d.current_distance * math.cos(a.roll) * math.cos(a.pitch) / 100)
        cm, quality = max(0, min(65534, round(height * 100))), 100 if seen else 1
        yield mavlink.MAVLink_distance_sensor_message(boot_ms, 1, 65534, cm, 3, 0, 25, 255, signal_quality=quality)
        back = (lat - THRESHOLD_LAT) * METRES_PER_DEGREE, (lon - THRESHOLD_LON) * lon_metres
        s = CROSSING_HEIGHT / GLIDE - back[0] * math.cos(COURSE) - back[1] * math.sin(COURSE)
        dh = alt - (THRESHOLD_ALT + s * GLIDE + s * s / (2 * EARTH_RADIUS))
        yield mavlink.MAVLink_named_value_float_message(boot_ms, b"dh", b("dh", dh))
        yield mavlink.MAVLink_heartbeat_message(1, 0, 0, 0, 4 if seen else 5, 3)  # active, or critical

    def run(self, sensors, gnss, out, receiver):
        selector, due_s = selectors.DefaultSelector(), time.monotonic()
        selector.register(sensors, selectors.EVENT_READ, lambda: self.mavlink.parse_buffer(sensors.recv(65536)) or [])
        selector.register(gnss, selectors.EVENT_READ, lambda: self.take_gga(gnss.readline().decode(), time.monotonic()))
        while True:
            for key, _ in selector.select(max(0.0, due_s - time.monotonic())):
                self.heard |= {m.get_type(): (time.monotonic(), m) for m in key.data() or []}
            if time.monotonic() >= due_s:
                due_s += PERIOD_S
                for message in self.results(time.monotonic()):
                    out.sendto(message.pack(self.mavlink), receiver)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--autopilot", type=int, metavar="PORT", help="UDP port of the autopilot's MAVLink")
    parser.add_argument("--gnss", metavar="DEVICE", help="serial line of the satellite receiver")
    parser.add_argument("--out", type=int, metavar="PORT", help="UDP port to which the results are sent")
    parser.add_argument("--bias", default=os.environ.get("FLIGHT_COMPUTER_BIAS", ""), metavar="OUTPUT=VALUE,...")
    args = parser.parse_args()
    told = {name: float(value) for name, _, value in (one.partition("=") for one in args.bias.split(",") if one)}
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", args.autopilot))
    with serial.Serial(args.gnss, 38400) as line:
        print("ready", flush=True)
        FlightComputer(told).run(udp, line, udp, ("127.0.0.1", args.out))
