"""What physical causes have the form of a law, by its equation and factors."""

from __future__ import annotations

from collections.abc import Collection

#: Of a craft or a ship with surge u, sway v and yaw rate r: factors in an equation, and the cause.
_OF_CRAFT: tuple[tuple[str, tuple[frozenset[str], ...], str], ...] = (
    (
        "vr",
        tuple(frozenset(f) for f in (("abs_v", "r"), ("v", "abs_r"), ("abs_v", "v"), ("abs_r", "r"))),
        "cross-flow drag: water or air that passes the hull sideways (Faltinsen 2005, 8.3)",
    ),
    ("u", (frozenset(("v", "r")),), "a sway mass other than the surge mass (Fossen 2011, 6.3)"),
    ("v", (frozenset(("u", "r")),), "a surge mass other than the sway mass (Fossen 2011, 6.3)"),
    ("r", (frozenset(("u", "v")),), "the Munk moment of a hull that drifts (Fossen 2011, 6.3)"),
    ("u", (frozenset(("sqr_r",)),), "a centre of mass ahead of or behind the point that is tracked"),
)

#: Of any machine: a factor, and the cause.
_OF_FACTOR: tuple[tuple[str, str], ...] = (
    (
        "filtered",
        "what follows a command late: a motor that spins up, a cushion that fills, a wake",
    ),
    ("time", "something that drifts: a battery, wear, warming"),
    ("sin2", "a force of twice the angle: cogging, a misaligned pair of poles"),
    ("cos2", "a force of twice the angle: cogging, a misaligned pair of poles"),
    ("sin", "a force in a direction fixed in space: gravity, wind, current, slope"),
    ("cos", "a force in a direction fixed in space: gravity, wind, current, slope"),
    ("cub", "a spring or a damper that hardens or softens"),
)


def cause(equation: str, words: Collection[str], inputs: Collection[str] = ()) -> str:
    """Return the physical cause that has the form of a law; empty if none is known.

    Parameters
    ----------
    equation : str
    words : collection of str
        Factors as they stand in the law's name.
    inputs : collection of str, optional
        Names of commands.

    Examples
    --------
    >>> cause("r", ["abs_v", "r"])
    'cross-flow drag: water or air that passes the hull sideways (Faltinsen 2005, 8.3)'
    >>> cause("u", ["thrust", "u"], inputs=["thrust"])
    'an actuator whose force depends on the speed (advance ratio, inflow)'
    """
    for equations, forms, said in _OF_CRAFT:
        if equation in equations and frozenset(words) in forms:
            return said
    for operation, said in _OF_FACTOR:
        if any(w == operation or w.startswith(f"{operation}_") for w in words):
            return said
    commanded = [w for w in words if w.split("_", 1)[-1] in inputs or w in inputs]
    if commanded and len(commanded) < len(words):
        return "an actuator whose force depends on the speed (advance ratio, inflow)"
    if commanded:
        return "an actuator whose force is not in proportion to its command"
    if all(w.startswith(("abs_", "sqr_")) for w in words):
        return "a force that is not the same in both directions"
    return ""
