"""How much gain, phase, delay and jitter a loop bears at one of its wires, about a point or along a motion.

The loop is broken at a signal, linearised by its exact Jacobians, and judged as one loop with all others
closed. Along a motion it is linearised at each instant as if time stood still there (frozen): that is a
guide for slow references, not a proof.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Literal

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.text_table import aligned
from hovercontrol.blocks.backends.trim import Trim
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.cut_loop import CutLoop
from hovercontrol.control.analysis.loop_modes import OutsideModes, split_loop, split_sampled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Relative step of a gain to both sides of an edge.
STEP = 1e-3

ALL_DECAY = OutsideModes()

#: Units of the margins; 1 is a factor.
UNITS = {
    "gain_up": "1", "gain_down": "1", "phase": "deg", "crossover": "rad/s", "disk": "1", "disk_gain": "1",
    "disk_phase": "deg", "delay": "s", "jitter": "s",
}  # fmt: skip

#: A factor as small, or its inverse, stands for none at all.
SMALL = 1e-9


@checked
@dataclass(frozen=True)
class Margins:
    """What a loop bears at one wire before it is unstable; NaN where it is unstable as it is.

    Attributes
    ----------
    stable : bool
        Whether the linearised loop is stable and no mode outside it grows.
    gain_up, gain_down : float
        Factors of the gain, above and below 1, at which it is at the edge; inf and 0 where it bears all.
    phase : float
        Smallest phase margin [deg]; inf where the gain never crosses 1.
    crossover : float
        Frequency at which it has that [rad/s].
    disk : float
        Diameter alpha of the balanced disk of gains and phases at once that it bears.
    disk_gain, disk_phase : float
        Gain factor, up or down, and phase [deg] within that disk.
    delay : float
        Longest constant delay [s]: phase margin over crossover, the least of all crossovers.
    jitter : float
        Every delay that varies as it likes within 0 and this [s] is borne: ``1/max |w T(j w)|``, after Kao
        and Lincoln (2004), the theorem that K06 section 5.3.3 names. Sufficient, so never above `delay`; NaN
        of a sampled loop.
    outside : OutsideModes
        The modes that do not decay and that the loop through the wire does not change: a position that
        nobody feeds back integrates. They count in no margin.
    loop : control.StateSpace or None
        The loop that was judged, for the plot.

    Examples
    --------
    >>> Margins(stable=False).gain_up
    nan
    """

    stable: bool
    gain_up: float = math.nan
    gain_down: float = math.nan
    phase: float = math.nan
    crossover: float = math.nan
    disk: float = math.nan
    disk_gain: float = math.nan
    disk_phase: float = math.nan
    delay: float = math.nan
    jitter: float = math.nan
    outside: OutsideModes = ALL_DECAY
    loop: control.StateSpace | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        found = {name: getattr(self, name) for name in UNITS}
        factors = ("gain_up", "gain_down", "disk_gain")
        units = UNITS | {
            name: f"= {20 * math.log10(found[name]):.3g} dB" for name in factors if 0 < found[name] < math.inf
        }
        rows = [(name, f"{v:.4g}", units[name]) for name, v in found.items() if not math.isnan(v)]
        return "\n".join(
            [f"the loop is {'stable' if self.stable else 'unstable'}; {self.outside}", *aligned(rows)]
        )

    def plot(self) -> Figure:
        """Return the Bode plot of the loop, with crossover and phase and gain margins marked.

        Raises
        ------
        InputError
            If the loop is not known: of the worst margins along a motion, ``each`` knows theirs.
        """
        from hovercontrol.control.analysis.frequency_grid import frequencies_of
        from hovercontrol.control.analysis.frequency_plots import loop_figure

        if self.loop is None:
            raise InputError("margins: no loop to draw; margins() and loop_margins() return it with them")
        return open_in_pyplot(loop_figure(self.loop, self, frequencies_of(self.loop, None)))


#: The names of what can be drawn over time.
MARGINS = tuple(f.name for f in fields(Margins) if f.name not in ("outside", "loop"))


@checked
def margins(
    loop: Block | Sequence[Block],
    wire: str,
    at: ArrayLike | Mapping[str, float] | Trim | None = None,
    *,
    time: float | None = None,
    params: Mapping[str, float] | None = None,
    friction: Literal["smooth", "none", "describing"] = "smooth",
    amplitude: Mapping[str, float] | None = None,
) -> Margins:
    """Return the margins of a loop at one wire, linearised about a point.

    Parameters
    ----------
    loop : Block or sequence of Block
        The Blocks of the loop, or the loop that they make.
    wire : str
        Signal at which it is broken: one that a Block drives; of a loop in one Block a signal that its
        equations define, such as a command.
    at : Trim, mapping by name or array_like, shape (n_states,), optional
        Point of the closed loop: states, and inputs that nothing drives, over the start values of states.
    time : float, optional
        [s]; default that of the Trim, or 0.
    params : mapping, optional
        Parameter values by key.
    friction, amplitude
        Slope of dry friction, as for :meth:`hovercontrol.Block.linearize`.

    Raises
    ------
    InputError
        If a name or a number of values is wrong, or the loop has parts that tick or an input without value.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> law = Block("law", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})
    >>> found = margins([cart, law], "a")  # the loop k/s
    >>> round(found.phase, 3), round(found.delay, 5), round(found.jitter, 5)  # pi/(2 k) and 1/k
    (90.0, 0.7854, 0.5)
    """
    line = CutLoop(loop, wire).linearize(at, time, params, friction=friction, amplitude=amplitude)
    found = loop_margins(negative(line))
    if found.loop is not None:
        found.loop.up_to = line.up_to
    return found


@checked
def loop_margins(loop: control.StateSpace | control.TransferFunction) -> Margins:
    """Return the margins of a linear loop with one input and output and negative feedback.

    Of a sampled loop `jitter` is NaN: its theorem is of continuous loops.

    Raises
    ------
    InputError
        If the loop is another.

    Examples
    --------
    >>> import control
    >>> found = loop_margins(control.tf([2.0], [1.0, 0.0]))  # 2/s
    >>> round(found.phase, 6), round(found.delay, 5)
    (90.0, 0.7854)
    """
    sampled = loop.isdtime(strict=True)
    if not loop.issiso() or (sampled and loop.dt is True):
        raise InputError(
            f"margins: expected a loop with one input and one output and a known step, found {loop.ninputs} "
            f"and {loop.noutputs}, dt = {loop.dt}"
        )
    loop, outside = (split_sampled if sampled else split_loop)(control.ss(loop))
    closed = control.feedback(loop, 1)
    poles = closed.poles()
    if outside.grow or not (np.abs(poles) < 1 if sampled else np.real(poles) < 0).all():
        return Margins(stable=False, outside=outside, loop=loop)
    gains, phases, _, _, crossovers, _ = control.stability_margins(loop, returnall=True)
    gains = np.append(gains, _at_the_ends(loop)) if sampled else np.asarray(gains)
    gains = gains[(gains > SMALL) & (gains < 1 / SMALL)]
    gains = gains[[_is_edge(loop, gain) for gain in gains.tolist()]]
    phases, crossovers = np.radians(np.asarray(phases, dtype=float)), np.asarray(crossovers, dtype=float)
    least = int(np.argmin(np.abs(phases))) if len(phases) else -1
    late = np.mod(phases, 2 * np.pi) / crossovers
    disk, gain, phase = _disk(loop, crossovers)
    return Margins(
        stable=True,
        gain_up=float(min(gains[gains > 1], default=math.inf)),
        gain_down=float(max(gains[gains < 1], default=0.0)),
        phase=float(np.degrees(abs(phases[least]))) if len(phases) else math.inf,
        crossover=float(crossovers[least]) if len(phases) else math.nan,
        disk=disk,
        disk_gain=10 ** (gain / 20) if gain < -20 * math.log10(SMALL) else math.inf,
        disk_phase=phase,
        delay=float(min(late, default=math.inf)),
        jitter=math.nan if sampled else _jitter(closed),
        outside=outside,
        loop=loop,
    )


@checked
@dataclass(frozen=True, eq=False)
class FrozenMargins:
    """Margins of the frozen linearisations along a motion.

    Attributes
    ----------
    times : ndarray, shape (n,)
        [s]
    each : tuple of Margins

    Examples
    --------
    >>> found = FrozenMargins(np.array([0.0]), (Margins(stable=True, gain_up=2.0),))
    >>> found.each[0].gain_up
    2.0
    """

    times: Array
    each: tuple[Margins, ...]

    __repr__ = short_repr

    def __getitem__(self, name: str) -> Array:
        """Return one margin over time, shape (n,)."""
        check_known(name, MARGINS, f"no margin {name!r}")
        return np.array([getattr(m, name) for m in self.each], dtype=float)

    def plot(self) -> Figure:
        """Return phase, gain and delay margins over time as a picture."""
        from hovercontrol.control.analysis.frequency_plots import margins_figure

        return open_in_pyplot(margins_figure(self))

    @property
    def worst(self) -> Margins:
        """What is borne all the way, margin by margin; NaN if the loop is unstable anywhere."""
        outside = max((m.outside for m in self.each), key=lambda modes: (modes.grow, len(modes.poles)))
        if not self["stable"].all():
            return Margins(stable=False, outside=outside)
        found = {name: float(self[name].min()) for name in MARGINS if name != "stable"}
        found["gain_down"] = float(self["gain_down"].max())
        found["crossover"] = float(self["crossover"][np.argmin(self["phase"])])
        return Margins(stable=True, outside=outside, **found)


@checked
def margins_along(
    loop: Block | Sequence[Block],
    wire: str,
    motion: control.TimeResponseData,
    *,
    params: Mapping[str, float] | None = None,
) -> FrozenMargins:
    """Return the margins of the frozen linearisations along a motion, such as a period of a reference.

    Parameters
    ----------
    loop, wire
        As for :func:`margins`.
    motion : control.TimeResponseData
        Of the closed loop, states by name; each row is a point.
    params : mapping, optional
        Parameter values by key.

    Raises
    ------
    InputError
        As by :class:`CutLoop`.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, a, k = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2"), hc.Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> law = Block("law", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})
    >>> motion = hc.simulate(hc.interconnect([cart, law]), [0.0, 1.0])
    >>> found = margins_along([cart, law], "a", motion)
    >>> [round(m.phase, 3) for m in found.each]
    [90.0, 90.0]
    """
    each = tuple(loop_margins(negative(line)) for line in CutLoop(loop, wire).along(motion, params))
    return FrozenMargins(np.asarray(motion.time, dtype=float), each)


def negative(line: control.StateSpace) -> control.StateSpace:
    """Return the gain L for negative feedback of a cut loop, whose feedback is positive."""
    matrices = line.A, line.B, -line.C, -line.D, line.dt
    return control.StateSpace(*matrices, states=line.state_labels, remove_useless_states=False)


def _is_edge(loop: control.StateSpace, gain: float) -> bool:
    """Return whether the number of growing modes changes at this gain.

    Near a double pole at z = 1 a search for the phase of -180 deg finds gains at which it does not.
    """
    sampled = loop.isdtime(strict=True)

    def growing(factor: float) -> int:
        poles = control.feedback(factor * gain * loop, 1).poles()
        return int(((np.abs(poles) - 1 if sampled else np.real(poles)) > 0).sum())

    return growing(1 - STEP) != growing(1 + STEP)


def _at_the_ends(loop: control.StateSpace) -> list[float]:
    """Return the gains with which a sampled loop is at the edge at z = 1 and -1, which a search misses."""
    ends = [complex(loop(z, warn_infinite=False)) for z in (1.0, -1.0)]
    return [-1 / end.real for end in ends if np.isfinite(end) and end.real < 0]


def _jitter(closed: control.StateSpace) -> float:
    """Return 1/max |w T(j w)|; 0 where T feeds through at once, which bears no varying delay.

    The peak is sought on the axis: a bisection by the Hamiltonian's eigenvalues loses half of the digits. For
    w to infinity |w T| tends to |C B|.
    """
    if np.any(closed.D):
        return 0.0
    if not closed.nstates:
        return math.inf

    def size(log_w: float) -> float:
        return float(np.exp(log_w) * abs(closed(1j * np.exp(log_w))))

    logs = np.log(np.abs(closed.poles()))
    grid = np.sort(np.concatenate([np.linspace(logs.min() - 5, logs.max() + 5, 300), logs]))
    best = int(np.argmax([size(x) for x in grid]))
    near = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    peak = minimize_scalar(lambda x: -size(x), bounds=near, method="bounded", options={"xatol": 1e-9})
    largest = max(-float(peak.fun), size(grid[best]), abs((closed.C @ closed.B).item()))
    return 1 / largest if largest > 0 else math.inf


def _disk(loop: control.StateSpace, crossovers: Array) -> tuple[float, float, float]:
    """Return disk margin, disk-based gain [dB] and phase margin [deg], sought about all that happens."""
    roots = np.concatenate([loop.poles(), loop.zeros()]).astype(complex)
    if loop.isdtime(strict=True):
        roots = np.log(roots[np.abs(roots) > SMALL]) / loop.dt
    moving = np.abs(np.concatenate([roots, crossovers]))
    moving = moving[(moving > 1e-6) & (moving < 1e6)]
    low, high = (moving.min(), moving.max()) if len(moving) else (1.0, 1.0)
    top = np.pi / loop.dt if loop.isdtime(strict=True) else high * 100
    coarse = np.sort(np.concatenate([np.geomspace(min(low, top) / 100, top, 300), crossovers]))
    worst = int(np.argmin(control.disk_margins(loop, coarse, returnall=True)[0]))
    near = coarse[max(worst - 1, 0)], coarse[min(worst + 1, len(coarse) - 1)]
    disk, gain, phase = control.disk_margins(loop, np.linspace(*near, 201))
    return float(disk), float(gain), float(phase)
