"""Arguments of commands that receive from a zenoh router."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._arguments import number

if TYPE_CHECKING:
    from fti.config import ZenohTable

#: Keys of the login.
LOGIN_ARGUMENTS = ("ca_file", "certificate", "private_key", "user", "password_file")
#: Values older than this are shown as late, also over a slow link [s].
MAX_AGE_S = 2.0
max_age = number(0.0, 600.0, "0 to 600 seconds")


def add_router_arguments(
    parser: argparse.ArgumentParser, endpoint: str, *, is_required: bool
) -> argparse._ArgumentGroup:
    """Add endpoint, login and largest age; returns their group.  endpoint : name of the option with the endpoint"""
    group = parser.add_argument_group("router of several aircraft")
    group.add_argument(
        endpoint, dest="router", required=is_required, metavar="ENDPOINT", help="zenoh router, such as tls/ground:7447"
    )
    group.add_argument("--ca-file", metavar="FILE", help="PEM file of the authorities that may certify the router")
    group.add_argument("--certificate", metavar="FILE", help="PEM file of our certificate, with --private-key")
    group.add_argument("--private-key", metavar="FILE", help="PEM file of its private key")
    group.add_argument("--user", metavar="NAME", help="user name, with --password-file")
    group.add_argument("--password-file", metavar="FILE", help="file with the password, readable by its owner only")
    group.add_argument(
        "--max-age",
        type=max_age,
        default=MAX_AGE_S,
        metavar="S",
        help=f"a value is late above this age, or above its own limit (default: {MAX_AGE_S:g} s)",
    )
    return group


def router_table(args: argparse.Namespace) -> ZenohTable:
    """The endpoint and login.  Raises ConfigError that names the option."""
    from fti.config import ZenohTable, bind

    given = {name: getattr(args, name) for name in LOGIN_ARGUMENTS if getattr(args, name) is not None}
    return bind(ZenohTable, {"connect": args.router, **given}, "arguments")
