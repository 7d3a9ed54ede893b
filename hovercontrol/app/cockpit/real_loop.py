"""The real loop: K06's ground station, link and craft under the pilot's commands, in compiled code."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from hovercontrol.app.cockpit.disturbances import REAL_DISTURBANCES, note, possible
from hovercontrol.app.cockpit.laws import choices, energy
from hovercontrol.app.cockpit.orders import Flown
from hovercontrol.app.cockpit.real_block import ORDERS, ground_station
from hovercontrol.app.cockpit.real_laws import LAW, reference_key
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.compiled import CompiledBlock
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION

#: Outputs of the loop that the page shows under their own names.
STATION = (
    *(s.name for s in MOTION), "thrust", "rudder", "force_x", "force_y", "fan_speed_set", "drive_mode",
    *(f"{s.name}_told_received" for s in MOTION),
    *(f"{name}_received" for name in (
        "v_x_hat", "v_y_hat", "force_x_hat", "force_y_hat", "force_x_inertial", "force_y_inertial",
        "gyro_bias_hat", "acceleration_x_bias_hat", "acceleration_y_bias_hat",
        "platform_roll", "platform_pitch", "calibrating", "power_on_time", "lift_command",
    )),
    *(f"{way}_{what}" for way in ("uplink", "downlink") for what in ("age", "messages", "delivered", "lost")),
    "failsafe_on",
)  # fmt: skip

#: Faster than this [m/s, rad/s] a craft is not at rest.
STILL = 0.02


def flies_real(model: Model) -> bool:
    """Return whether a craft suits the real loop: K06's laws and actuators need a thrust in newton."""
    return len(choices(model)) > 1


@lru_cache(maxsize=2)
def _compiled(model: Model) -> CompiledBlock:
    return ground_station(model).compile(friction="smooth")


class RealLoop(Flown):
    """The real loop: link, navigation, actuators and their imperfections, from one hybrid Block.

    Parameters
    ----------
    model : Model
        The craft, with a thrust in newton.

    Raises
    ------
    InputError
        If the craft does not suit K06's laws.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> RealLoop(vehicle("four_fan"))
    Traceback (most recent call last):
    hovercontrol.base.errors.InputError: the real loop needs a craft whose thrust is in newton: try hoverdemon
    """

    kind = "real"
    logged = MappingProxyType({f"true_{s.name}": s.name for s in MOTION})

    def __init__(self, model: Model) -> None:
        if not flies_real(model):
            raise InputError("the real loop needs a craft whose thrust is in newton: try hoverdemon")
        super().__init__(
            model,
            choices(model),
            {**possible(model), **REAL_DISTURBANCES},
            {"transmit": True, "lift": True, "calibrate": False},
        )
        self._compiled = _compiled(model)
        block = self._compiled.block
        self._names = [s.name for s in block.outputs]
        self._modes = {s.name: s.modes for s in block.outputs if s.modes}
        self._own = block.default_parameters
        self._energy = Ticking(energy())
        self.inputs = tuple(block.signal(name) for name in ("thrust", "rudder"))
        self.reset()

    def reset(self) -> None:
        """Put the craft at its start, just switched on; law, references and disturbances are kept."""
        self._calibrations = 0
        self.switches["calibrate"] = False
        self._runner = self._compiled.start(params=self._parameters(), inputs=self._orders())

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return round(self._runner.time, 9)

    def modes(self) -> dict[str, tuple[str, ...]]:
        """Return the names of the modes of the present law, by signal."""
        begin = f"{self.law}_"
        told = {name.removeprefix(begin): m for name, m in self._modes.items() if name.startswith(begin)}
        return {name: m for name, m in told.items() if name in ("mode", "heading_mode")}

    def advance(self, until: float) -> None:
        """Advance simulated time to `until` [s].

        Raises
        ------
        InputError
            If the motion is not a number any more.
        """
        if until <= self.time:
            return
        self._runner.step(None, until - self._runner.time)
        if not all(math.isfinite(self._told(s.name)) for s in MOTION):
            raise InputError(f"the craft's motion is no longer a number at {self.time:.2f} s: reset it")
        # Until the ground station knows what was found, too.
        self.switches["calibrate"] = self._told("calibrating") + self._told("calibrating_received") > 0

    def signals(self) -> dict[str, float]:
        """Return the displayed signals by name, in SI units.

        Returns
        -------
        dict of str to float
            As for the ideal loop; ``..._measured`` are the navigation's estimates on board, and
            :data:`STATION` lists the signals at the ground station.
        """
        seen = dict(zip(self._names, self._runner.outputs.tolist(), strict=True))
        found = {"time": self.time, **{name: seen[name] for name in STATION}}
        found |= {f"{s.name}_measured": seen[f"{s.name}_hat"] for s in MOTION}
        begin = f"{self.law}_"
        for name in ("surge_ref", "yaw_rate_ref", "heading_ref", "mode", "heading_mode", "distance",
                     "goal_x_ref", "goal_y_ref", "goal_heading_ref"):  # fmt: skip
            if begin + name in seen:
                found[name] = seen[begin + name]
        for axis in "xy":
            found[f"wind_{axis}"] = self._runner_parameters[f"plant.wind_{axis}"] + seen[f"gust_{axis}"]
        return found | self._energy.tick(self.time, seen)

    def notes(self) -> str:
        """Return notes to the pilot on switches and disturbances, or ``""``."""
        if self.switches["calibrate"]:
            moves = any(abs(self._told(name)) > STILL for name in "uvr")
            return (
                "Calibrating: the craft moves, it should stand still."
                if moves
                else "Calibrating: keep still."
            )
        if not self.switches["transmit"]:
            return "Transmission is off: the craft hears nothing and stops its fans."
        if self._told("failsafe_on") and self.time > 1.0:
            return "The craft hears no commands and has stopped its fans."
        if not self.switches["lift"]:
            return "The lift fan is off: the craft stands on its skirt."
        drags = (self._runner_parameters[f"plant.{axis}_linear_drag"] for axis in ("surge", "sway"))
        return note(self.switched_on, drags)

    # ---- inside --------------------------------------------------------------------------------------

    def _obey(self, law: bool, references: bool, disturbances: bool, switched: Mapping[str, bool]) -> None:
        if switched.get("calibrate"):
            self._calibrations += 1
        changed = law or references or disturbances
        self._runner.set(inputs=self._orders(), params=self._parameters() if changed else None)

    def _told(self, name: str) -> float:
        return float(self._runner.outputs[self._names.index(name)])

    def _orders(self) -> dict[str, float]:
        values = (
            LAW.mode(self.law), *self.stick, self.switches["transmit"], self.switches["lift"],
            self._calibrations,
        )  # fmt: skip
        return {s.name: float(value) for s, value in zip(ORDERS, values, strict=True)}

    def _parameters(self) -> dict[str, float]:
        """Return the parameters set by the pilot's commands, by key."""
        values = {"gusts.speed": self.switched_on.get("gusts", {}).get("speed", 0.0)}
        for key, told in self.references.items():
            values |= {reference_key(key, name): value for name, value in told.items()}
        for key, disturbance in self.disturbances.items():
            for knob in disturbance.knobs:
                number = self.switched_on.get(key, {}).get(knob.signal.name, 0.0)
                for name in knob.parameters:
                    whole = name if "." in name else f"plant.{name}"
                    values[whole] = values.get(whole, self._own[whole]) + number
        self._runner_parameters = self._own | values
        return values
