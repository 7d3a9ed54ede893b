"""The ideal loop and the real one of a craft: each built when it is first flown, in a thread of its own."""

from __future__ import annotations

import asyncio

from hovercontrol.cockpit.loop import Loop
from hovercontrol.cockpit.orders import Flown
from hovercontrol.cockpit.pacer import Pacer
from hovercontrol.cockpit.real_loop import RealLoop
from hovercontrol.errors import InputError, did_you_mean, shown
from hovercontrol.models.model import Model

LOOPS: dict[str, type[Loop] | type[RealLoop]] = {"ideal": Loop, "real": RealLoop}


def loop_of(kind: str, model: Model) -> Flown:
    """Return a loop of a craft, ``ideal`` or ``real``.

    Raises
    ------
    InputError
        If there is no such loop (the nearest is named), or the craft cannot fly it.

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
    """The loops that a pacer may let fly.

    Parameters
    ----------
    pacer : Pacer
        Its craft is that of all loops.

    Attributes
    ----------
    building : bool
        Whether one is being built now.
    """

    def __init__(self, pacer: Pacer) -> None:
        self._pacer, self._known = pacer, {pacer.loop.kind: pacer.loop}
        self._model = pacer.loop.model
        self.building = False

    async def fly(self, kind: str) -> None:
        """Let another loop fly; time stands still while it is built.

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
