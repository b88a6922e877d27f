"""The commands that read files, as argument lists; SESSION, FILE and OUT are placeholders."""

from __future__ import annotations

from pathlib import Path

#: Of a session: each as it is called.
SESSION_COMMANDS: dict[str, tuple[str, ...]] = {
    "info": ("info", "SESSION"),
    "info -v": ("info", "-v", "SESSION"),
    "info --json": ("info", "SESSION", "--json", "--plot", "OUT/activity.html"),
    "verify": ("verify", "SESSION"),
    "verify --json": ("verify", "SESSION", "--json"),
    "recover": ("recover", "SESSION", "--out", "OUT/saved"),
    "recover --in-place": ("recover", "SESSION", "--in-place"),
    "pack": ("pack", "SESSION"),
    "pack --undo": ("pack", "SESSION", "--undo"),
    "export": ("export", "SESSION", "--out", "OUT/tables", "--raw"),
    "export parquet": ("export", "SESSION", "--out", "OUT/tables", "--format", "parquet", "--raw"),
    "reprocess": ("reprocess", "SESSION", "--out", "OUT/again", "--as-flown"),
    "sync": ("sync", "SESSION", "--out", "OUT/base.csv", "--plot", "OUT/clocks.html"),
    "sync --json": ("sync", "SESSION", "--out", "OUT/base.mcap", "--json"),
    "latency": ("latency", "SESSION"),
    "score": ("score", "silence", "SESSION"),
    "compare": ("compare", "SESSION", "SESSION"),
    "replay": ("replay", "SESSION", "--links", "OUT/links", "--speed", "1000000", "--wait", "0"),
    "reference make": (
        *("reference", "make", "--airfield", "AIRFIELD", "--recorded", "SESSION", "--sensor", "altimeter"),
        *("--out", "OUT/x.csv"),
    ),
    "check": ("check", "SESSION/config.toml"),
    "hil --plot": ("hil", "SESSION/recorded.toml", "--plot", "OUT/flight.png"),
}
#: Of one file, by its kind.
FILE_COMMANDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "config": (
        ("check", "FILE"),
        ("check", "FILE", "--json"),
        ("hil", "nominal", "--config", "FILE", "--plot", "OUT/f.png"),
    ),
    "scenario": (("hil", "FILE", "--plot", "OUT/f.png"), ("score", "FILE", "SESSION")),
    "dbc": (("decode", "capture.log", "--driver", "dbc", "--option", "dbc_file=FILE"),),
    "labels": (("decode", "FILE", "--driver", "arinc429", "--option", "labels_file=FILE"),),
    "capture": (
        ("decode", "FILE", "--driver", "nmea0183"),
        ("decode", "FILE", "--driver", "canaerospace"),
        ("decode", "FILE", "--driver", "imar_ixcom", "--json"),
    ),
    "elevation": (
        ("terrain", "info", "FILE", "--vertical", "ellipsoid"),
        ("terrain", "plot", "FILE", "--vertical", "ellipsoid", "--out", "OUT/map.png"),
    ),
    "reference": (("reference", "info", "FILE"), ("reference", "info", "FILE", "--json")),
    "airfield": (("reference", "make", "--airfield", "FILE", "--terrain", "nowhere.tif", "--out", "OUT/x.csv"),),
}


def filled(command: tuple[str, ...], places: dict[str, Path]) -> list[str]:
    """The arguments with the places in them."""
    return [_filled(argument, places) for argument in command]


def _filled(argument: str, places: dict[str, Path]) -> str:
    for name, place in places.items():
        argument = argument.replace(name, str(place))
    return argument
