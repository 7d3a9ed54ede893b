"""The ideal and the real loop of a craft, each built on first use in a separate thread."""

from __future__ import annotations

import asyncio

from hovercontrol.cockpit.loop import Loop
from hovercontrol.cockpit.orders import Flown
from hovercontrol.cockpit.pacer import Pacer
from hovercontrol.cockpit.real_loop import RealLoop
from hovercontrol.cockpit.watch import Watch, watch_block
from hovercontrol.errors import InputError, did_you_mean, shown
from hovercontrol.models.model import Model

LOOPS: dict[str, type[Loop] | type[RealLoop]] = {"ideal": Loop, "real": RealLoop}


def loop_of(kind: str, model: Model) -> Flown:
    """Return a loop of a craft, ``ideal`` or ``real``.

    Raises
    ------
    InputError
        If there is no such loop, or the craft does not suit it.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import vehicle
    >>> loop_of("reel", vehicle("hoverdemon"))
    Traceback (most recent call last):
    hovercontrol.errors.InputError: unknown loop 'reel'; did you mean 'real'?
    """
    if kind not in LOOPS:
        raise InputError(f"unknown loop {shown(kind)}{did_you_mean(kind, LOOPS)}")
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
                self._known[kind] = await asyncio.to_thread(loop_of, kind, self._model)
            finally:
                self.building = False
        self._pacer.fly(self._known[kind])

    async def watch(self) -> None:
        """Let a monitor watch the present loop; time stands still while it is built.

        Raises
        ------
        InputError
            As of :func:`.watch.watch_block`.
        """
        self.building = True
        try:
            watch = await asyncio.to_thread(lambda: Watch(watch_block(self._pacer.loop.model)))
        finally:
            self.building = False
        self._pacer.monitor(watch)
