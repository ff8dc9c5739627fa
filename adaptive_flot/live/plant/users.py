"""Who may talk to the test plant: a trusted certificate, and a user name with its password; nobody else."""

from __future__ import annotations

import hashlib
import hmac
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from asyncua.crypto.permission_rules import User, UserRole
from cryptography import x509

LONGEST_PASSWORD = 256


class Users:
    """User manager of the server: asks every session for a trusted certificate and a password.

    The certificate is that of the encrypted channel itself. (asyncua's own check reads the one that the client names in
    its request, and lets a request without one pass.)

    Parameters
    ----------
    passwords
        Password of each user.
    trusted
        Certificate files (DER) of the clients that are trusted.
    """

    def __init__(self, passwords: Mapping[str, str], trusted: Iterable[Path]) -> None:
        self._salt = os.urandom(16)
        self._hashes = {name: self._hash(password) for name, password in passwords.items()}
        self._trusted = frozenset(_der(file) for file in trusted)

    def get_user(
        self, iserver: Any, username: Any = None, password: Any = None, certificate: Any = None
    ) -> User | None:
        """The user, None where one of the three is wrong; see `asyncua.server.user_managers.UserManager`."""
        del iserver
        if not (isinstance(username, str) and isinstance(password, str) and len(password) <= LONGEST_PASSWORD):
            return None
        given = self._hash(password)
        known = self._hashes.get(username)
        right = hmac.compare_digest(given, known if known is not None else bytes(len(given)))
        if not right or known is None or bytes(certificate or b"") not in self._trusted:
            return None
        return User(role=UserRole.User, name=username)

    def _hash(self, password: str) -> bytes:
        return hashlib.scrypt(password.encode(), salt=self._salt, n=2**12, r=8, p=1)


def _der(file: Path) -> bytes:
    """The certificate in a file, checked to be one."""
    content = file.read_bytes()
    x509.load_der_x509_certificate(content)
    return content
