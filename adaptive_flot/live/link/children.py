"""Processes beside the cycles: they end with the link, and the cycle goes first."""

from __future__ import annotations

import os

from adaptive_flot.child_processes import end_with_parent

NICE = 10
"""How much lower their priority is, and that of the processes that they start."""


def beside_the_cycle(link: int) -> None:
    """To be called first in such a process.

    Parameters
    ----------
    link
        Process identifier of the link.
    """
    end_with_parent(link)
    os.nice(NICE)
