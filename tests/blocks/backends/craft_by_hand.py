"""The vehicles' equations as a user of python-control writes them, and their derivatives by complex steps."""

import control as ct
import numpy as np

from hovercontrol.craft.models.vehicles import VEHICLES, vehicle

FANS = ("rear_left", "rear_right", "front_left", "front_right")
#: A moving point of every craft, away from the kinks of dry friction.
X = np.array([0.3, -0.2, 0.4, 0.9, -0.1, 0.6])


def commands(name):
    return np.array([0.6, 0.5, 0.1, 0.2]) if name == "four_fan" else np.array([1.5, 0.2])


def rudder_craft(t, x, u, p):
    """C17 (11); K06's craft is the same without drag."""
    _, _, psi, surge, sway, yaw = x
    thrust, rudder = u

    def drag(axis, speed):
        dry, width = p.get(f"plant.{axis}_coulomb", 0.0), p.get(f"plant.{axis}_coulomb_width", 1.0)
        return dry * np.tanh(speed / width) + p.get(f"plant.{axis}_linear_drag", 0.0) * speed

    return np.array(
        [
            surge * np.cos(psi) - sway * np.sin(psi),
            surge * np.sin(psi) + sway * np.cos(psi),
            yaw,
            sway * yaw - drag("surge", surge) + p["plant.thrust"] * thrust * np.cos(rudder),
            -surge * yaw - drag("sway", sway) + p["plant.thrust"] * thrust * np.sin(rudder),
            -drag("yaw", yaw) - p["plant.rudder_torque"] * thrust * np.sin(rudder),
        ]
    )


def four_fan_craft(t, x, u, p):
    """Two fans push ahead, two astern, each beside the centre line."""
    _, _, psi, surge, sway, yaw = x
    left, right, front_left, front_right = u
    torque = sum(p[f"plant.{fan}_arm"] * command for fan, command in zip(FANS, u, strict=True))
    ahead = p["plant.fan_force"] * (left + right - front_left - front_right)
    return np.array(
        [
            surge * np.cos(psi) - sway * np.sin(psi),
            surge * np.sin(psi) + sway * np.cos(psi),
            yaw,
            sway * yaw - p["plant.surge_linear_drag"] * surge + ahead,
            -surge * yaw - p["plant.sway_linear_drag"] * sway,
            p["plant.fan_torque"] * torque - p["plant.yaw_linear_drag"] * yaw,
        ]
    )


def by_hand(name):
    """Return a craft as ``control.nlsys`` of equations written by hand, with the Block's values and names."""
    block = vehicle(name).plant()
    return ct.nlsys(
        four_fan_craft if name == "four_fan" else rudder_craft,
        None,
        params=dict(block.default_parameters),
        states=["x", "y", "psi", "u", "v", "r"],
        outputs=["x", "y", "psi", "u", "v", "r"],
        inputs=list(FANS) if name == "four_fan" else ["thrust", "rudder"],
        name="plant",
    )


def linear_by_hand(name, x, u):
    """Return the linearisation by complex steps, exact to rounding, as ``control.ss``."""
    hand, h = by_hand(name), 1e-30

    def columns(step_of):
        return np.array([step_of(e).imag / h for e in np.eye(len(x) if step_of is by_x else len(u))]).T

    def by_x(e):
        return hand.updfcn(0.0, x + 1j * h * e, u, hand.params)

    def by_u(e):
        return hand.updfcn(0.0, x, u + 1j * h * e, hand.params)

    return ct.ss(columns(by_x), columns(by_u), np.eye(len(x)), np.zeros((len(x), len(u))))


NAMES = list(VEHICLES)
