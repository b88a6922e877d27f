"""Certificates of loopback, made by openssl."""

from __future__ import annotations

import subprocess
from pathlib import Path


def make_certificates(folder: Path, name: str) -> tuple[Path, Path, Path]:
    """An authority and a certificate of loopback by it: authority, certificate, key."""
    ca, ca_key, key = folder / f"{name}_ca.pem", folder / f"{name}_ca.key", folder / f"{name}.key"
    request, certificate, extra = folder / f"{name}.csr", folder / f"{name}.pem", folder / f"{name}.ext"
    new_key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    _openssl("req", "-x509", *new_key, "-keyout", str(ca_key), "-out", str(ca), "-subj", f"/CN={name} authority")
    _openssl("req", *new_key, "-keyout", str(key), "-out", str(request), "-subj", "/CN=127.0.0.1")
    extra.write_text("subjectAltName=IP:127.0.0.1,DNS:localhost\n")
    signing = ("-CA", str(ca), "-CAkey", str(ca_key), "-CAcreateserial", "-extfile", str(extra))
    _openssl("x509", "-req", "-in", str(request), *signing, "-out", str(certificate), "-days", "2")
    key.chmod(0o644)
    return ca, certificate, key


def _openssl(*arguments: str) -> None:
    subprocess.run(["openssl", *arguments], check=True, capture_output=True)
