"""Certificates, keys and passwords for a link and a test plant on this machine, made once and never overwritten."""

from __future__ import annotations

import ipaddress
import os
import re
import secrets
import socket
from dataclasses import dataclass
from pathlib import Path

from asyncua.crypto.cert_gen import (
    dump_private_key_as_pem,
    generate_private_key,
    generate_self_signed_app_certificate,
)
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID

from adaptive_flot.errors import LinkError, OutputError

PLANT, LINK, OPERATOR = "plant", "link", "operator"
USES = {
    PLANT: ExtendedKeyUsageOID.SERVER_AUTH,
    LINK: ExtendedKeyUsageOID.CLIENT_AUTH,
    OPERATOR: ExtendedKeyUsageOID.CLIENT_AUTH,
}
USERS = (LINK, OPERATOR)
TOKENS = ("view", "act")
"""Tokens of the page: for viewing, and for acting."""
VALID_DAYS = 365
PRIVATE = 0o600
LABEL = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_-]{0,61}[A-Za-z0-9])?")
"""A label of the name of a host."""


@dataclass(frozen=True)
class Identity:
    """Who an application is: the files of its certificate (DER) and private key (PEM)."""

    name: str
    certificate: Path
    key: Path

    @property
    def uri(self) -> str:
        """Application URI, which the certificate must name too (OPC 10000-6, 6.2.2)."""
        return application_uri(self.name)

    def checked(self) -> Identity:
        """Itself; LinkError where a file is missing."""
        for file in (self.certificate, self.key):
            if not file.is_file():
                raise LinkError(f"{file}: no such file; make it with `adaptive-flot certificates`, or name another")
        return self


def application_uri(name: str) -> str:
    """Application URI of a part of this program."""
    return f"urn:adaptive-flot:{name}"


def identity(folder: Path, name: str) -> Identity:
    """The identity of that name in a folder that `make_certificates` wrote."""
    return Identity(name, folder / f"{name}.der", folder / f"{name}.pem")


def password_file(folder: Path, user: str) -> Path:
    """File of a user's password."""
    return folder / f"{user}.password"


def token_file(folder: Path, name: str) -> Path:
    """File of a token of the page."""
    return folder / f"{name}.token"


def read_password(file: Path) -> str:
    """Password in a file; LinkError where there is none."""
    try:
        password = file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise LinkError(f"{file}: can not be read ({reason}); name the file that holds the password") from error
    if not password:
        raise LinkError(f"{file}: holds no password; write it into the first line")
    return password


def make_certificates(folder: Path, hosts: tuple[str, ...] = ("localhost", "127.0.0.1")) -> list[Path]:
    """Make self-signed certificates (RSA 2048, SHA-256), keys and passwords for plant, link and operator.

    The tokens of the page are made too.

    Parameters
    ----------
    folder
        Where they go; keys, passwords and tokens can be read by their owner only.
    hosts
        Names and addresses of the plant that its certificate is good for; the name of this machine is added.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    LinkError
        A host is neither an address nor a name.
    OutputError
        One of the files is there already, or the folder can not be written.
    """
    wrong = [host for host in hosts if not _is_host(host)]
    if wrong:
        raise LinkError(f"{wrong[0]!r} is no name or address of a host; give one such as plant.example or 10.0.0.5")
    files = [*(f for name in USES for f in (folder / f"{name}.der", folder / f"{name}.pem"))]
    secret = [*(password_file(folder, user) for user in USERS), *(token_file(folder, name) for name in TOKENS)]
    files += secret
    there = [file for file in files if file.exists()]
    if there:
        raise OutputError(f"{there[0]}: is there already; give another folder with --out, or remove it yourself")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, use in USES.items():
            key = generate_private_key()
            names = [x509.UniformResourceIdentifier(application_uri(name)), *_hosts(hosts)]
            certificate = generate_self_signed_app_certificate(
                key, f"adaptive-flot {name}", {"organizationName": "adaptive-flot"}, names, [use], VALID_DAYS
            )
            _write(folder / f"{name}.pem", dump_private_key_as_pem(key), PRIVATE)
            _write(folder / f"{name}.der", certificate.public_bytes(Encoding.DER), 0o644)
        for file in secret:
            _write(file, (secrets.token_urlsafe(24) + "\n").encode(), PRIVATE)
    except OSError as error:
        raise OutputError(f"{folder}: can not be written ({error.strerror or error}); give another folder") from error
    return files


def _hosts(hosts: tuple[str, ...]) -> list[x509.GeneralName]:
    named = dict.fromkeys([*hosts, socket.gethostname()])
    return [_host(host) for host in named]


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _is_host(host: str) -> bool:
    """Whether a text is an address, or a name as RFC 1123 writes it."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return len(host) <= 253 and all(LABEL.fullmatch(label) for label in host.split("."))
    return True


def _write(file: Path, content: bytes, mode: int) -> None:
    """Write a new file that nobody else could read meanwhile."""
    handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(handle, "wb") as stream:
        stream.write(content)
