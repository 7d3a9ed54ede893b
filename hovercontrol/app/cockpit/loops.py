"""The ideal and the real loop of a craft, and its monitor, each built on first use in a separate thread."""

from __future__ import annotations

import asyncio
import multiprocessing
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from multiprocessing.connection import Connection
from typing import Any, TypeVar, cast

from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.orders import Flown
from hovercontrol.app.cockpit.pacer import Pacer
from hovercontrol.app.cockpit.real_loop import RealLoop
from hovercontrol.app.cockpit.watch import Watch, watch_block
from hovercontrol.base.errors import check_known, shown
from hovercontrol.craft.models.model import Model

T = TypeVar("T")

LOOPS: dict[str, type[Loop] | type[RealLoop]] = {"ideal": Loop, "real": RealLoop}


def loop_of(kind: str, model: Model) -> Flown:
    """Return a loop of a craft, ``ideal`` or ``real``.

    Raises
    ------
    InputError
        If there is no such loop, or the craft does not suit it.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> loop_of("reel", vehicle("hoverdemon"))
    Traceback (most recent call last):
    hovercontrol.base.errors.InputError: unknown loop 'reel'; did you mean 'real'?
    """
    check_known(kind, LOOPS, f"unknown loop {shown(kind)}")
    return LOOPS[kind](model)


class Loops:
    """The loops of a pacer.

    Parameters
    ----------
    pacer : Pacer
        Its craft is used in all loops.

    Attributes
    ----------
    building : bool
        Whether a loop is being built.
    """

    def __init__(self, pacer: Pacer) -> None:
        self._pacer, self._known = pacer, {pacer.loop.kind: pacer.loop}
        self._model = pacer.loop.model
        self.building = False

    async def fly(self, kind: str) -> None:
        """Switch to another loop; time stands still while it is built.

        Raises
        ------
        InputError
            As of :func:`loop_of`.
        """
        if kind not in self._known:
            self.building = True
            try:
                self._known[kind] = await built(lambda: loop_of(kind, self._model))
            finally:
                self.building = False
        self._pacer.fly(self._known[kind])

    async def watch(self) -> None:
        """Let a monitor watch the present loop, once it is built in a process of its own.

        Time goes on meanwhile: in this process the building would hold up the pacer and the pilot's messages.

        Raises
        ------
        InputError
            As of :func:`.watch.watch_block`.
        """
        self.building = True
        try:
            watch = await built(lambda: Watch(elsewhere(watch_block, self._pacer.loop.model)))
        finally:
            self.building = False
        self._pacer.monitor(watch)


async def built(make: Callable[[], T]) -> T:
    """Return what a function makes in a thread of its own; the end of the process does not wait for it."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[T] = loop.create_future()

    def finish(set_: Callable[[T], None] | Callable[[Exception], None], found: T | Exception) -> None:
        if not done.done():  # it may be cancelled
            set_(found)  # type: ignore[arg-type]

    def work() -> None:
        set_: Callable[[T], None] | Callable[[Exception], None]
        found: T | Exception
        try:
            set_, found = done.set_result, make()
        except Exception as error:
            set_, found = done.set_exception, error
        with suppress(RuntimeError):  # the loop of events has ended
            loop.call_soon_threadsafe(finish, set_, found)

    threading.Thread(target=work, name="cockpit: building", daemon=True).start()
    return await done


@lru_cache(maxsize=2)
def elsewhere(make: Callable[[Model], T], model: Model) -> T:
    """Return what a function makes of a craft in a process of its own, which ends with this one.

    Raises
    ------
    InputError, RuntimeError
        As of the function, or if the process ends without a result.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, make, model), daemon=True)
    process.start()
    sender.close()
    try:
        found = receiver.recv()
    except EOFError:
        raise RuntimeError("the process that builds the monitor ended without a result") from None
    process.join()
    if isinstance(found, Exception):
        raise found
    return cast(T, found)


def _send(sender: Connection, make: Callable[[Model], Any], model: Model) -> None:
    try:
        sender.send(make(model))
    except Exception as error:
        sender.send(error)
