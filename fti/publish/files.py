"""Files that ``[publish]`` names: passwords and certificates."""

from __future__ import annotations

import os
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
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            line = file.readline(MAX_PASSWORD_BYTES)
    except OSError as error:
        raise SinkError(f"{key} = {path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # a null byte in the path
        raise SinkError(f"{key} = {path!a}: cannot be read: {error}") from None
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
            context.load_cert_chain(table.certificate, table.private_key, password=_no_passphrase)
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError; a null byte in a path
        files = ", ".join(file for file in (table.ca_file, table.certificate, table.private_key) if file)
        raise SinkError(f"{name}: ca_file, certificate, private_key: {files}: {error}") from None
    return context


def _no_passphrase() -> str:
    """Refuse OpenSSL's request for a passphrase, which would block the process.  Raises ValueError."""
    raise ValueError("the private key is encrypted; it must have no passphrase")
