"""Failed log-ins by address: after a few, each further attempt from there has to wait, longer every time."""

from __future__ import annotations

import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable

FREE = 3
"""Wrong tokens from an address before it has to wait."""
LONGEST_S = 60.0
"""A person who shares the address with whoever guesses waits no longer than this."""
FORGOTTEN_S = 900.0
"""Quiet time after which an address begins anew."""
MOST_ADDRESSES = 1024
"""Addresses that are kept; the one that failed longest ago is forgotten first."""


class Attempts:
    """What is known of addresses from which a wrong token came; no address makes another one wait.

    Parameters
    ----------
    clock
        Time [s], which does not go back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._failed: OrderedDict[str, tuple[int, float]] = OrderedDict()  # how often, and when last

    def wait_s(self, address: str) -> float:
        """How long the next attempt from an address has to wait [s]; 0 where it may be made."""
        count, last = self._failed.get(_network(address), (0, 0.0))
        if count < FREE:
            return 0.0
        pause = min(2.0 ** (count - FREE), LONGEST_S)
        return max(0.0, last + pause - self._clock())

    def failed(self, address: str) -> None:
        """Take down a wrong token. A right one resets nothing: the view token must not help to guess the other."""
        key, now = _network(address), self._clock()
        count, last = self._failed.pop(key, (0, now))
        self._failed[key] = (min(count, FREE + 10) + 1 if now - last < FORGOTTEN_S else 1, now)
        while len(self._failed) > MOST_ADDRESSES:
            self._failed.popitem(last=False)


def _network(address: str) -> str:
    """An address of IPv4 as it is; of IPv6 the network that one machine can choose its addresses from (/64)."""
    try:
        known = ipaddress.ip_address(address)
    except ValueError:
        return address
    return address if known.version == 4 else str(ipaddress.ip_network((known, 64), strict=False))
