"""Files that ``[publish]`` names: passwords and certificates."""

from __future__ import annotations

import ssl
import stat
from pathlib import Path

from fti.config import TlsKeys
from fti.publish.sink import SinkError

READABLE_BY_OTHERS = stat.S_IRWXG | stat.S_IRWXO
MAX_PASSWORD_BYTES = 4096


def read_password(path: str, key: str) -> str:
    """The first line of a password file.

    key : of the configuration, for errors
    Raises SinkError when it cannot be read, is empty, or other users may read it.
    """
    try:
        with Path(path).open("rb") as file:
            mode = stat.S_IMODE(Path(path).stat().st_mode)
            line = file.readline(MAX_PASSWORD_BYTES)
    except OSError as error:
        raise SinkError(f"{key} = {path}: cannot be read: {error.strerror}") from None
    if mode & READABLE_BY_OTHERS:
        raise SinkError(f"{key} = {path}: other users can read it (mode {mode:04o}); chmod 600 {path}")
    try:
        password = line.decode().rstrip("\r\n")
    except UnicodeDecodeError:
        raise SinkError(f"{key} = {path}: is not UTF-8 text") from None
    if not password:
        raise SinkError(f"{key} = {path}: the first line is empty; it must be the password")
    return password


def make_tls_context(table: TlsKeys, name: str) -> ssl.SSLContext:
    """Settings of a TLS client that checks name and certificate of its peer.

    name : of the table in the configuration, for errors
    Raises SinkError when a file cannot be read, or has no certificate or key.
    """
    try:
        context = ssl.create_default_context(cafile=table.ca_file)
        if table.certificate:
            context.load_cert_chain(table.certificate, table.private_key)
    except OSError as error:  # ssl.SSLError is one
        files = ", ".join(file for file in (table.ca_file, table.certificate, table.private_key) if file)
        raise SinkError(f"{name}: ca_file, certificate, private_key: {files}: {error}") from None
    return context
