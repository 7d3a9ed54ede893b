"""A loop with a sampled controller, noise and a delay."""

import hovercontrol as hc
from hovercontrol.blocks.random_numbers import random_numbers

v, a = hc.Signal("v", "m/s", start=1.0), hc.Signal("a", "m/s^2")


def sampled_loop():
    """A cart braked by a sampled controller that sees noise and whose command comes late."""
    seen, k, size = (
        hc.Signal("seen", "m/s"),
        hc.Signal("k", "1/s", start=2.0),
        hc.Signal("size", "m/s", start=0.01),
    )
    push, late = hc.Signal("push", "m/s^2"), hc.Signal("late", "s", start=0.03)
    noise = random_numbers(1, salt="sensor")
    cart = hc.Block(
        "cart", [v], [a, push], [v], [late], {"v": a.symbol + push.symbol}, delays={"push": late.symbol}
    )
    sensor = hc.Block(
        "sensor", noise.states, [v], [seen], (*noise.parameters, size), noise.next_values,
        {"seen": v.symbol + size.symbol * noise.values[0]}, noise.definitions, period=0.0065536,
    )  # fmt: skip
    brake = hc.Block(
        "brake", [], [seen], [a], [k], output_expressions={"a": -k.symbol * seen.symbol}, period=0.02
    )
    return hc.interconnect([cart, sensor, brake], "braked")
