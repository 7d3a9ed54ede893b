"""State feedback about an operating point: the linear-quadratic regulator and pole placement.

Both return ``u = u0 - K (x - x_ref)`` as a Block whose gains are parameters (:mod:`.feedback`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import place_poles

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.friction_slopes import Slope
from hovercontrol.blocks.block import Block
from hovercontrol.control.controllers.design import Design, by_name, design_of
from hovercontrol.control.controllers.feedback import Form, Gains, state_feedback
from hovercontrol.control.controllers.friction_feedforward import feedforward
from hovercontrol.control.controllers.modes import refuse_unmovable, refuse_unweighted, warn_of_unmoved
from hovercontrol.control.controllers.weights import Weights, chosen_weights, weight_matrix

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.trim import Trim


@checked
def lqr(
    plant: Block,
    trim: Trim | control.OperatingPoint | Mapping[str, float],
    Q: Weights | None = None,
    R: Weights | None = None,
    *,
    max_states: Mapping[str, float] | None = None,
    max_inputs: Mapping[str, float] | None = None,
    states: Sequence[str] | None = None,
    period: float | None = None,
    friction: Slope = "none",
    amplitude: Mapping[str, float] | None = None,
    compensate_friction: bool | None = None,
    limits: bool = True,
    measured: str = "{}",
    name: str = "controller",
) -> Block:
    """Return the linear-quadratic regulator about an operating point.

    It minimises the integral of ``dx' Q dx + du' R du`` of the linearised plant; for a sampled controller the
    sum over the samples, with inputs held in between, and for a sampled plant the sum over its steps.

    Parameters
    ----------
    plant : Block
        Continuous, or sampled; the controller of a sampled plant is sampled, too.
    trim : Trim, control.OperatingPoint or mapping
        The operating point: ``plant.trim(...)``, a ``control.OperatingPoint``, or values of states and inputs
        by name [their units].
    Q : mapping or array_like, scalar, shape (n_states,) or (n_states, n_states), optional
        Weights of the states [1/unit^2], by name, as a diagonal or as a matrix.
    R : mapping or array_like, scalar, shape (n_inputs,) or (n_inputs, n_inputs), optional
        Weights of the inputs, likewise. Only inputs with a weight are commanded.
    max_states, max_inputs : mapping, optional
        In place of `Q` and `R`: the largest acceptable deviation of each [its unit]. The weight is
        1/deviation^2 (Bryson's rule).
    states : sequence of str, optional
        The states that are fed back. Default with weights by name: those with a weight and all on which
        these depend, so that ``{"y": 1, "psi": 1}`` holds a line and leaves x free. Default otherwise: all
        that do not move at the operating point. Of these only such as an output shows; others (lags of
        actuators) are taken to follow their inputs at once.
    period : float, optional
        Of a sampled controller [s]: designed on the exact discretisation with held inputs. Of a sampled plant
        a multiple of its period (default: its period).
    friction : {"none", "smooth", "describing"}, optional
        How dry friction enters the linear model. "none": as a constant force without damping, which holds for
        every velocity beyond the smoothing width; take it for a craft under way, also for its sway and yaw
        at rest. "smooth": with the slope of the regularised friction, a pole at -c/width that the craft has
        only below that width; with Coulomb's friction (``compile(friction="events")``) such a design sticks
        beside its setpoint. "describing": with the slope that an oscillation of `amplitude` feels. What
        friction leaves, a small oscillation or offset, is smaller with more weight on the position.
    compensate_friction : bool, optional
        Add the optimal command against the dry friction of states at rest, as a known disturbance: ``F
        sgn(v)`` with the parameters ``F_rudder_r`` and ``r_width`` (default: where friction is "none").
        Without it dry friction in yaw makes a craft weave about its line several times as wide.
    amplitude : mapping of str to float, optional
        Of the oscillation, by state, in its unit, for "describing".
    limits : bool, optional
        Keep the commands within the bounds of the plant's inputs.
    measured : str, optional
        Names of what the controller reads: ``"{}_hat"`` reads ``u_hat``, an estimator's output.
    name : str, optional

    Returns
    -------
    Block
        Inputs: the states by the plant's names and their setpoints (``y``, ``y_ref``), which start at the
        operating point; outputs: the commands. Errors of angles are wrapped to (-pi, pi]. Parameters: the
        gains ``K_rudder_y``, the commands at the operating point ``rudder_trim``, the limits.

    Raises
    ------
    InputError
        If a name is unknown, a weight is not positive (semi)definite, a state moves at the operating point,
        no input moves a mode that does not decay, or no weight sees one on the imaginary axis.

    Warns
    -----
    UserWarning
        If at the operating point no input moves a state with a weight, and the gain of one is 0.

    References
    ----------
    Astrom & Murray, Feedback Systems, 2nd edition, section 7.5; Bryson & Ho, Applied Optimal Control, 1975.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> plant = c17_simulation().plant()
    >>> straight = plant.trim({"u": 1.0, "r": 0.0, "psi": 0.0})
    >>> hold = lqr(plant, straight, {"y": 1.0, "u": 1.0}, {"thrust": 1.0, "rudder": 4.0})
    >>> [s.name for s in hold.inputs]
    ['y', 'psi', 'u', 'v', 'r', 'y_ref', 'psi_ref', 'u_ref', 'v_ref', 'r_ref']
    >>> round(hold.default_parameters["controller.K_rudder_y"], 4)
    -0.5
    """
    Q = chosen_weights("lqr", Q, max_states, ("Q", "max_states"))
    R = chosen_weights("lqr", R, max_inputs, ("R", "max_inputs"))
    design = design_of(
        "lqr",
        plant,
        trim,
        friction=friction,
        amplitude=amplitude,
        states=states,
        inputs=by_name(R),
        weighted=by_name(Q),
        compensate=friction == "none" if compensate_friction is None else compensate_friction,
        estimated=measured != "{}",
    )
    q = weight_matrix("lqr: Q", named("lqr: Q", design, Q, plant), design.names, definite=False)
    r = weight_matrix("lqr: R", R, design.input_names, definite=True)
    refuse_unsolvable("lqr", design, q)
    design = design.over("lqr", period)
    K, F = optimal_gains("lqr", design, q, r)
    return state_feedback(design, without_integrals(K, F), form_of("lqr", design, limits, measured, name))


@checked
def place(
    plant: Block,
    trim: Trim | control.OperatingPoint | Mapping[str, float],
    poles: Sequence[float | complex] | NDArray[np.complex128],
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    period: float | None = None,
    friction: Slope = "none",
    amplitude: Mapping[str, float] | None = None,
    limits: bool = True,
    measured: str = "{}",
    name: str = "controller",
) -> Block:
    """Return the state feedback that places the poles of the linearised loop.

    Parameters
    ----------
    plant : Block
        Continuous, or sampled; the controller of a sampled plant is sampled, too.
    trim : Trim, control.OperatingPoint or mapping
        As for :func:`lqr`.
    poles : array_like, shape (n_states,)
        Poles of the loop [1/s], complex ones in pairs; a pole repeated at most as often as there are inputs.
        Those of a sampled controller of a continuous plant are placed at exp(pole * period). Those of a
        sampled plant are given as z, inside the unit circle.
    states : sequence of str, optional
        The states that are fed back (default: all that do not move at the operating point).
    inputs : sequence of str, optional
        The inputs that are commanded (default: all).
    period, friction, amplitude, limits, measured, name
        As for :func:`lqr` [s].

    Returns
    -------
    Block
        As of :func:`lqr`.

    Raises
    ------
    InputError
        If a name is unknown, no input moves a mode, or the poles are not as many as the states, not in pairs,
        or not stable: negative real parts, or of a sampled plant inside the unit circle.

    References
    ----------
    Tits & Yang, IEEE Trans. Autom. Control 41 (1996), by :func:`scipy.signal.place_poles`.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> y, v, a = Signal("y", "m"), Signal("v", "m/s"), Signal("a", "m/s^2")
    >>> cart = Block("cart", [y, v], [a], [y, v], derivatives={"y": v.symbol, "v": a.symbol})
    >>> hold = place(cart, cart.trim({"y": 0.0}), [-1 + 1j, -1 - 1j])
    >>> {key: round(value, 9) for key, value in hold.default_parameters.items()}
    {'controller.a_trim': 0.0, 'controller.K_a_y': 2.0, 'controller.K_a_v': 2.0}
    """
    design = design_of(
        "place",
        plant,
        trim,
        friction=friction,
        amplitude=amplitude,
        states=states,
        inputs=inputs,
        estimated=measured != "{}",
    )
    wanted = np.atleast_1d(np.asarray(poles, dtype=complex))
    n = len(design.states)
    if wanted.shape != (n,):
        raise InputError(
            f"place: expected {n} poles for the states {', '.join(design.names)}, found {wanted.size}"
            f"{_left_out(design, plant)}"
        )
    refuse_unmovable(
        "place", design.A, design.B, design.names, design.input_names, every=True, sampled=design.period > 0.0
    )
    found = ", ".join(f"{pole.real:g}{f'{pole.imag:+g}j' if pole.imag else ''}" for pole in wanted)
    if design.period and np.abs(wanted).max() >= 1.0:
        raise InputError(
            f"place: poles: those of a sampled plant lie inside the unit circle, found {found}; "
            f"a pole s [1/s] is exp({design.period:g} s)"
        )
    if not design.period and wanted.real.max() >= 0.0:
        raise InputError(f"place: poles: expected negative real parts [1/s], found {found}")
    held = design.over("place", period)
    A, B = held.with_integrals()
    try:
        poles = np.exp(wanted * held.period) if held.period and not design.period else wanted
        K = place_poles(A, B, poles).gain_matrix
    except ValueError as error:
        raise InputError(f"place: poles: {error}") from None
    gains = without_integrals(K, np.zeros((len(K), 0)))
    return state_feedback(held, gains, form_of("place", held, limits, measured, name))


def refuse_unsolvable(where: str, design: Design, Q: Array) -> None:
    """Raise if no input moves a mode that does not decay, or no weight sees one that keeps its size.

    Raises
    ------
    InputError
        Naming the mode.

    Warns
    -----
    UserWarning
        If an input's gain is 0 and no input moves a state with a weight.
    """
    A, B = design.with_integrals()
    names, sampled = [*design.names, *design.integral_names], design.period > 0.0
    frictions = [design.names[f.state] for f in design.frictions]
    refuse_unmovable(
        where, A, B, names, design.input_names, every=False, sampled=sampled, frictions=frictions
    )
    refuse_unweighted(where, A, Q, names, sampled=sampled)
    warn_of_unmoved(where, A, B, Q, names, design.input_names)


def optimal_gains(where: str, design: Design, Q: Array, R: Array) -> tuple[Array, Array]:
    """Return the optimal gains on states and integrals, and the optimal commands against friction.

    Shapes (n_inputs, n_states + n_integrals) and (n_inputs, n_frictions).

    Raises
    ------
    InputError
        If the problem has no stabilising solution.
    """
    import control  # takes a second

    A, B = design.with_integrals()
    sampled = design.period > 0.0
    try:
        K, P, _ = (control.dlqr if sampled else control.lqr)(A, B, Q, R)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise InputError(f"{where}: the Riccati equation has no stabilising solution: {error}") from None
    F = feedforward(A, B, design.disturbances(), K, P, R, sampled=sampled)
    return np.asarray(K, dtype=float), F


def without_integrals(K: Array, F: Array) -> Gains:
    """Return the gains of a feedback of states alone."""
    return Gains(K, np.zeros((len(K), 0)), np.zeros((0, len(K))), F)


def form_of(where: str, design: Design, limits: bool, measured: str, name: str) -> Form:
    """Return the options of the realisation; check the arguments."""
    if "{}" not in measured:
        raise InputError(f"{where}: measured: expected a text with {{}} for the name, found {measured!r}")
    return Form(design.period, limits, measured, name)


def _left_out(design: Design, plant: Block) -> str:
    """Return the end of a message that says which states are not fed back, and why; empty if all are."""
    fed_back = {m.state for m in design.states}
    left = ", ".join(s.name for s in plant.states if s.name not in fed_back)
    if not left:
        return ""
    return (
        f"; {left} is not fed back: no output shows it, or it moves at the operating point "
        "(states=... chooses, measured='{}_hat' reads an estimator)"
    )


def named(where: str, design: Design, given: Any, plant: Block) -> Any:
    """Return weights by the names under which the controller reads the states.

    Raises
    ------
    InputError
        If a matrix has a row for each of the plant's states, of which some are not fed back.
    """
    if not isinstance(given, Mapping):
        size, left = len(np.atleast_1d(given)), _left_out(design, plant)
        if left and size == len(plant.states) and size > len(design.names) + len(design.integral_names):
            raise InputError(
                f"{where}: expected weights of {', '.join(design.names)}, found {size} rows{left}"
            )
        return given
    symbols = {s.symbol: s.name for s in plant.states}
    shown = {symbols[e]: o.name for o in plant.outputs if (e := plant.output_expressions[o.name]) in symbols}
    return {key if key in design.names else shown.get(key, key): value for key, value in given.items()}
