"""A function in a process of its own, its result when it is asked for."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from adaptive_flot.child_processes import end_with_parent, forking
from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.plugins import plugin_failure

Result = TypeVar("Result")


class Background(Generic[Result]):
    """A call that goes on beside this process; where it may not fork, the call runs when its result is asked for.

    It may not where the system can not, and in a worker of a study, whose cores have other runs to do.

    Parameters
    ----------
    function
        What to call. It may close over anything (models do not pickle); its result must pickle.
    """

    def __init__(self, function: Callable[[], Result]) -> None:
        self._function = function
        self._process = None
        may = "fork" in multiprocessing.get_all_start_methods() and not multiprocessing.current_process().daemon
        if may:
            context = multiprocessing.get_context("fork")
            self._receiver, sender = context.Pipe(duplex=False)
            self._process = context.Process(target=_call, args=(function, sender, os.getpid()))
            with forking():
                self._process.start()
            sender.close()

    def result(self) -> Result:
        """Wait for the result.

        Raises
        ------
        AdaptiveFlotError
            The process ended without one.
        Exception
            What the function raised.
        """
        if self._process is None:
            return self._function()
        try:
            good, value = self._receiver.recv()
        except EOFError as error:
            raise AdaptiveFlotError("the process of a search ended without a result (out of memory?)") from error
        finally:
            self.stop()
        if good:
            result: Result = value
            return result
        raise value

    def stop(self) -> None:
        """End the process, whatever it has done so far."""
        if self._process is not None:
            self._process.terminate()
            self._process.join()
            self._receiver.close()


def _call(function: Callable[[], object], sender: Connection, parent: int) -> None:
    end_with_parent(parent)
    try:
        answer: tuple[bool, object] = (True, function())
    except (Exception, SystemExit) as error:
        answer = (False, plugin_failure(error) or error)  # the traceback stays here
    try:
        sender.send(answer)
    except Exception as error:  # what does not pickle is said, not waited for
        sender.send((False, AdaptiveFlotError(f"the result of a search can not be sent: {error}")))
