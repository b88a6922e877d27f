"""A third-party flight computer: an autopilot and a satellite receiver in, position, height and glide path out."""

import argparse
import math
import selectors
import socket
import time
from collections import defaultdict

import serial
from pymavlink.dialects.v20 import common as mavlink

METRES_PER_DEGREE, GLIDE, COURSE = 111_132.0, math.tan(math.radians(3.0)), math.radians(275.0)
THRESHOLD_LAT, THRESHOLD_LON, THRESHOLD_ALT, CROSSING_HEIGHT = 36.63, -84.1675, 360.0, 15.24
EARTH_RADIUS, PERIOD_S, MAX_AGE_S, GNSS_LATENCY_S, GNSS_SHARE = 6_371_000.0, 0.1, 0.3, 0.06, 0.05


class FlightComputer:
    def __init__(self, bias):
        self.bias, self.start_s, self.mavlink = bias, time.monotonic(), mavlink.MAVLink(None, srcSystem=42)
        self.messages = {}  # name of a message -> (when it was true, the message)
        self.clock_s = math.inf  # this computer's clock minus the autopilot's, by the message with the smallest delay
        self.offset = [0.0, 0.0]  # of the receiver from the autopilot: north, east [m]

    def take(self, message, now_s):
        """Keep a message with the time of its validity."""
        boot_s = getattr(message, "time_boot_ms", math.nan) / 1000
        self.clock_s = min(self.clock_s, now_s - boot_s)
        self.messages[message.get_type()] = (boot_s + self.clock_s, message)

    def position(self, now_s):
        """Latitude, longitude [deg], altitude [m] of the autopilot, carried on by its velocity."""
        t_s, m = self.messages["GLOBAL_POSITION_INT"]
        after_s, lat = now_s - t_s, m.lat / 1e7
        lon_metres = METRES_PER_DEGREE * 1.0018 * math.cos(math.radians(lat))
        north, east, down = (v / 100 * after_s for v in (m.vx, m.vy, m.vz))
        return lat + north / METRES_PER_DEGREE, m.lon / 1e7 + east / lon_metres, m.alt / 1000 - down, lon_metres

    def take_gga(self, line, now_s):
        """Filter the position offset towards the receiver's position."""
        f = line.split(",")
        if not f[0].endswith("GGA") or f[6] in ("", "0") or "GLOBAL_POSITION_INT" not in self.messages:
            return
        degrees = (float(f[i][:n]) + float(f[i][n:]) / 60 for i, n in ((2, 2), (4, 3)))
        lat, lon = (-angle if f[i] in "SW" else angle for angle, i in zip(degrees, (3, 5), strict=True))
        own_lat, own_lon, _, lon_metres = self.position(now_s - GNSS_LATENCY_S)
        found = (lat - own_lat) * METRES_PER_DEGREE, (lon - own_lon) * lon_metres
        self.offset = [old + GNSS_SHARE * (new - old) for old, new in zip(self.offset, found, strict=True)]

    def results(self, now_s):
        """The messages that are due; none before the first messages of all sensors."""
        if not {"GLOBAL_POSITION_INT", "ATTITUDE", "DISTANCE_SENSOR"} <= set(self.messages):
            return
        boot_ms, bias = round((now_s - self.start_s) * 1000), self.bias
        lat, lon, alt, lon_metres = self.position(now_s)
        north, east = self.offset[0] + bias["north"], self.offset[1] + bias["east"]
        position = lat + north / METRES_PER_DEGREE, lon + east / lon_metres, alt + bias["alt"]
        position = [round(value * scale) for value, scale in zip(position, (1e7, 1e7, 1e3), strict=True)]
        m, a = self.messages["GLOBAL_POSITION_INT"][1], self.messages["ATTITUDE"][1]
        speeds = [v + round(100 * bias[name]) for v, name in ((m.vx, "vel_n"), (m.vy, "vel_e"), (m.vz, "vel_d"))]
        yield mavlink.MAVLink_global_position_int_message(boot_ms, *position, 0, *speeds, 65535)
        angles = a.roll + bias["roll"], a.pitch + bias["pitch"], a.yaw + bias["heading"]
        yield mavlink.MAVLink_attitude_message(boot_ms, *angles, a.rollspeed, a.pitchspeed, a.yawspeed)
        range_s, d = self.messages["DISTANCE_SENSOR"]
        valid = d.signal_quality != 1 and now_s - range_s < MAX_AGE_S
        cm = max(0, round(d.current_distance * math.cos(a.roll) * math.cos(a.pitch) + 100 * bias["height"]))
        yield mavlink.MAVLink_distance_sensor_message(boot_ms, 1, 65534, cm, 3, 0, 25, 0, signal_quality=1 + 99 * valid)
        back = (lat - THRESHOLD_LAT) * METRES_PER_DEGREE, (lon - THRESHOLD_LON) * lon_metres
        s = CROSSING_HEIGHT / GLIDE - back[0] * math.cos(COURSE) - back[1] * math.sin(COURSE)
        dh = alt - (THRESHOLD_ALT + s * GLIDE + s * s / (2 * EARTH_RADIUS))
        yield mavlink.MAVLink_named_value_float_message(boot_ms, b"dh", dh + bias["dh"])
        yield mavlink.MAVLink_heartbeat_message(1, 0, 0, 0, 4 if valid else 5, 3)  # active, or critical

    def run(self, sensors, gnss, out, receiver):
        selector, due_s = selectors.DefaultSelector(), time.monotonic()
        selector.register(sensors, selectors.EVENT_READ, lambda: self.mavlink.parse_buffer(sensors.recv(65536)) or [])
        selector.register(gnss, selectors.EVENT_READ, lambda: self.take_gga(gnss.readline().decode(), time.monotonic()))
        while True:
            for key, _ in selector.select(max(0.0, due_s - time.monotonic())):
                for message in key.data() or []:
                    self.take(message, time.monotonic())
            if time.monotonic() >= due_s:
                due_s += PERIOD_S
                for message in self.results(time.monotonic()):
                    out.sendto(message.pack(self.mavlink), receiver)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--autopilot", type=int, metavar="PORT", help="UDP port of the autopilot's MAVLink")
    parser.add_argument("--gnss", metavar="DEVICE", help="serial line of the satellite receiver")
    parser.add_argument("--out", type=int, metavar="PORT", help="UDP port to which the results are sent")
    parser.add_argument("--bias", default="", metavar="OUTPUT=VALUE,...", help="make outputs wrong: a test must fail")
    args = parser.parse_args()
    bias = {name: float(value) for name, _, value in (one.partition("=") for one in args.bias.split(",") if one)}
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", args.autopilot))
    with serial.Serial(args.gnss, 38400) as line:
        print("ready", flush=True)
        FlightComputer(defaultdict(float, bias)).run(udp, line, udp, ("127.0.0.1", args.out))
