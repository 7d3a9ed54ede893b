"""Blocks are wired by signal name; the whole is what the matrix algebra says it is."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, prefix, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import circle, ellipse
from hovercontrol.craft.models.vehicles import c17_simulation, hoverdemon

coefficients = st.integers(-8, 8).map(lambda k: k / 4)


def linear(name, A, B, C, D, inputs, outputs) -> Block:
    """x' = A x + B u, y = C x + D u with plain numbers."""
    states = [Signal(f"s{i}") for i in range(len(A))]
    per_second = Signal("per_second", "1/s", start=1.0)
    x = sp.Matrix([s.symbol for s in states])
    ins, outs = [Signal(n) for n in inputs], [Signal(n) for n in outputs]
    u = sp.Matrix([s.symbol for s in ins])

    def rows(M, N):
        total = sp.zeros(len(M), 1)
        if states:
            total += sp.Matrix(M) * x
        if ins:
            total += sp.Matrix(N) * u
        return list(total)

    return Block(
        name,
        states,
        ins,
        outs,
        [per_second] if states else [],
        {s.name: per_second.symbol * e for s, e in zip(states, rows(A, B) if states else [], strict=True)},
        {s.name: e for s, e in zip(outs, rows(C, D), strict=True)},
    )


def matrices(block):
    f = block.to_numpy()
    n, m = len(block.states), len(block.inputs)
    return [
        f.jacobian(0.0, np.zeros(n), np.zeros(m), None, r, c)
        for r in ("derivatives", "outputs")
        for c in ("states", "inputs")
    ]


@st.composite
def siso(draw, n_max=2):
    n = draw(st.integers(0, n_max))
    row = st.lists(coefficients, min_size=n, max_size=n)
    A = draw(st.lists(row, min_size=n, max_size=n))
    B = draw(st.lists(st.lists(coefficients, min_size=1, max_size=1), min_size=n, max_size=n))
    return A, B, [draw(row)], [[draw(coefficients)]]


def as_arrays(system):
    A, B, C, D = system
    n = len(A)
    return [
        np.array(M, dtype=float).reshape(s) for M, s in ((A, (n, n)), (B, (n, 1)), (C, (1, n)), (D, (1, 1)))
    ]


def in_series(systems):
    """(A, B, C, D) of systems one behind the other."""
    A, B, C, D = as_arrays(systems[0])
    for system in systems[1:]:
        A2, B2, C2, D2 = as_arrays(system)
        n, n2 = len(A), len(A2)
        A = np.block([[A, np.zeros((n, n2))], [B2 @ C, A2]])
        B = np.vstack([B, B2 @ D])
        C = np.hstack([D2 @ C, C2])
        D = D2 @ D
    return A, B, C, D


@given(st.lists(siso(), min_size=1, max_size=4))
def test_a_chain_is_the_product_of_its_links(systems):
    blocks = [linear(f"b{k}", *system, [f"w{k}"], [f"w{k + 1}"]) for k, system in enumerate(systems)]
    whole = interconnect(blocks, inputs=["w0"], outputs=[f"w{len(blocks)}"])
    for found, expected in zip(matrices(whole), in_series(systems), strict=True):
        assert np.allclose(found, expected, rtol=1e-12, atol=1e-12)


@given(st.lists(siso(), min_size=2, max_size=4), st.randoms())
def test_the_order_of_blocks_changes_nothing_but_the_order_of_states(systems, random):
    blocks = [linear(f"b{k}", *system, [f"w{k}"], [f"w{k + 1}"]) for k, system in enumerate(systems)]
    shuffled = list(blocks)
    random.shuffle(shuffled)
    last = f"w{len(blocks)}"
    one, two = (interconnect(b, inputs=["w0"], outputs=[last]) for b in (blocks, shuffled))
    order = [[s.name for s in two.states].index(s.name) for s in one.states]
    A1, B1, C1, D1 = matrices(one)
    A2, B2, C2, D2 = matrices(two)
    assert np.allclose(A1, A2[np.ix_(order, order)], atol=1e-12)
    assert np.allclose(B1, B2[order], atol=1e-12)
    assert np.allclose(C1, C2[:, order], atol=1e-12)
    assert np.allclose(D1, D2, atol=1e-12)


@given(st.lists(siso(), min_size=1, max_size=4), siso())
def test_a_star_feeds_every_arm_from_the_hub(arms, hub):
    hub_block = linear("hub", *hub, ["w"], ["h"])
    blocks = [hub_block, *(linear(f"arm{k}", *arm, ["h"], [f"y{k}"]) for k, arm in enumerate(arms))]
    whole = interconnect(blocks, outputs=[f"y{k}" for k in range(len(arms))])
    _, _, C, D = matrices(whole)
    names = [s.name for s in whole.states]
    for k, arm in enumerate(arms):
        A1, B1, C1, D1 = in_series([hub, arm])
        mine = [i for i, n in enumerate(names) if n.startswith(("hub.", f"arm{k}."))]
        A, B, _, _ = matrices(whole)
        assert np.allclose(A[np.ix_(mine, mine)], A1, atol=1e-12)
        assert np.allclose(B[mine], B1, atol=1e-12)
        assert np.allclose(C[k][mine], C1[0], atol=1e-12)
        assert np.allclose(D[k], D1[0], atol=1e-12)
        assert not np.delete(C[k], mine).any()


@given(siso(), siso())
def test_feedback_is_the_matrix_algebra_of_feedback(plant, law):
    A, B, C, _D = as_arrays(plant)
    F, G, H, J = as_arrays(law)
    strictly_proper = [*plant[:3], [[0.0]]]
    if not len(A):
        return
    blocks = [linear("plant", *strictly_proper, ["a"], ["y"]), linear("law", *law, ["y"], ["a"])]
    whole = interconnect(blocks)
    assert whole.inputs == ()
    expected = np.block([[A + B @ J @ C, B @ H], [G @ C, F]])
    assert np.allclose(matrices(whole)[0], expected, atol=1e-12)
    assert np.allclose(matrices(interconnect(blocks, outputs=["a"]))[2], np.hstack([J @ C, H]), atol=1e-12)


def test_inputs_that_nothing_drives_become_inputs_of_the_whole():
    craft = c17_simulation()
    whole = interconnect([tracking_controller(craft, adapt=["yaw_coulomb"]), craft.plant()])
    assert [s.name for s in whole.inputs] == [
        "x_ref",
        "y_ref",
        "vx_ref",
        "vy_ref",
        "ax_ref",
        "ay_ref",
        "yaw_coulomb_hat",
    ]
    assert whole.signal("yaw_coulomb_hat").start == 0.83


def test_one_open_input_of_two_blocks_is_one_input_of_the_whole():
    blocks = [
        linear("p", [], [], [[]], [[2.0]], ["w"], ["y"]),
        linear("q", [], [], [[]], [[3.0]], ["w"], ["z"]),
    ]
    assert interconnect(blocks).to_numpy().outputs(0.0, (), [1.0]).tolist() == [2.0, 3.0]


def test_an_algebraic_loop_is_refused_with_the_loop_spelled_out():
    blocks = [
        linear("p", [], [], [[]], [[2.0]], ["c"], ["a"]),
        linear("q", [], [], [[]], [[3.0]], ["a"], ["b"]),
        linear("r", [], [], [[]], [[4.0]], ["b"], ["c"]),
    ]
    with pytest.raises(
        InputError,
        match=r"algebraic loop: (p\.a -> q\.b -> r\.c -> p\.a|q\.b -> r\.c -> p\.a -> q\.b"
        r"|r\.c -> p\.a -> q\.b -> r\.c)",
    ):
        interconnect(blocks)


def test_a_block_wired_to_itself_is_an_algebraic_loop():
    with pytest.raises(InputError, match=r"algebraic loop: p\.a -> p\.a"):
        interconnect([Block("p", inputs=[Signal("a")], outputs=[Signal("a")])])


def test_a_loop_through_a_state_is_no_algebraic_loop():
    lag = linear("lag", [[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["b"], ["a"])
    gain = linear("gain", [], [], [[]], [[3.0]], ["a"], ["b"])
    assert matrices(interconnect([gain, lag]))[0] == pytest.approx(np.array([[2.0]]))


def test_two_outputs_of_one_name_are_refused_until_one_is_renamed():
    one, two = circle(1.0), circle(2.0, name="other")
    with pytest.raises(InputError, match=r"'reference' and 'other' both have an output 'x_ref'.*rename"):
        interconnect([one, two])
    both = interconnect([one, prefix(two, "other")])
    assert [s.name for s in both.outputs[:1]] + [s.name for s in both.outputs[6:7]] == [
        "x_ref",
        "other_x_ref",
    ]


def test_two_blocks_of_one_name_are_refused():
    with pytest.raises(InputError, match="two blocks are named 'reference'"):
        interconnect([circle(1.0), rename(circle(1.0), {s.name: f"{s.name}2" for s in circle(1.0).outputs})])


def test_units_are_checked_along_each_wire():
    p = Block(
        "p",
        [Signal("s", "m")],
        [],
        [Signal("w", "m")],
        derivatives={"s": sp.S.Zero},
        output_expressions={"w": Signal("s").symbol},
    )
    q = Block("q", [Signal("s", "m")], [Signal("w", "m/s")], derivatives={"s": Signal("w").symbol})
    with pytest.raises(InputError, match=r"'w' is in m in block 'p' but in m/s in block 'q'"):
        interconnect([p, q])


def test_wanted_signals_must_be_there_and_open_inputs_must_be_wanted():
    craft = c17_simulation()
    parts = [craft.plant()]
    with pytest.raises(InputError, match="no input 'ruder'; did you mean 'rudder'"):
        interconnect(parts, inputs=["thrust", "ruder"])
    with pytest.raises(InputError, match="nothing drives the input 'rudder'"):
        interconnect(parts, inputs=["thrust"])
    with pytest.raises(InputError, match="no output 'phi'"):
        interconnect(parts, outputs=["phi"])
    with pytest.raises(InputError, match="no blocks"):
        interconnect([])
    assert [s.name for s in interconnect(parts, inputs=["rudder", "thrust"], outputs=["r"]).inputs] == [
        "rudder",
        "thrust",
    ]


@pytest.mark.parametrize("signals", [{"thurst": "force"}, {"thrust": "u"}, {"x": "y"}, {"u": "rudder"}])
def test_renaming_what_is_not_there_or_to_what_is_taken_is_refused(signals):
    with pytest.raises(InputError):
        rename(hoverdemon().plant(), signals)


def test_inputs_can_swap_names():
    swapped = rename(
        Block(
            "b",
            inputs=[Signal("p", "m"), Signal("q", "m")],
            outputs=[Signal("y", "m")],
            output_expressions={"y": 2 * Signal("p").symbol - Signal("q").symbol},
        ),
        {"p": "q", "q": "p"},
    )
    assert swapped.to_numpy().outputs(0.0, (), [1.0, 0.0]).tolist() == [2.0]  # the first input, now called q
    assert swapped.equations() == "y = -p + 2*q"


def test_a_renamed_plant_keeps_its_dynamics(rng):
    plant = c17_simulation().plant()
    renamed = rename(plant, {"thrust": "T", "u": "surge"})
    assert [s.name for s in renamed.states] == [s.name for s in plant.states]
    x, u = rng.normal(size=6), rng.normal(size=2)
    assert np.array_equal(renamed.to_numpy().derivatives(0, x, u), plant.to_numpy().derivatives(0, x, u))


def test_two_craft_in_one_system_have_their_own_parameters_and_do_not_meet(rng):
    left, right = (
        prefix(c17_simulation().plant(), "left"),
        prefix(c17_simulation().plant(), "right"),
    )
    both = interconnect([left, right])
    x, u = rng.normal(size=12), rng.normal(size=4)
    alone = c17_simulation().plant().to_numpy()
    found = both.to_numpy().derivatives(0.0, x, u, {"right.yaw_coulomb": 0.0})
    assert np.allclose(found[:6], alone.derivatives(0.0, x[:6], u[:2]), atol=1e-14)
    assert np.allclose(
        found[6:], alone.derivatives(0.0, x[6:], u[2:], {"plant.yaw_coulomb": 0.0}), atol=1e-14
    )


def loop(name, radius=1.0):
    craft = c17_simulation()
    return interconnect([circle(radius), tracking_controller(craft), craft.plant()], name)


def test_a_whole_can_be_a_part_and_its_keys_stay(rng):
    inner = loop("inner")
    outer = interconnect(
        [
            inner,
            Block(
                "watch",
                [Signal("way", "m*s")],
                [Signal("error_x", "m")],
                derivatives={"way": Signal("error_x").symbol},
            ),
        ],
        "outer",
    )
    assert set(inner.default_parameters) <= set(outer.default_parameters)
    x = rng.normal(size=6)
    assert np.allclose(
        outer.to_numpy().derivatives(0.2, [*x, 0.0])[:6],
        inner.to_numpy().derivatives(0.2, x),
        atol=1e-13,
    )
    assert outer.to_numpy().derivatives(0.2, [*x, 0.0])[6] == pytest.approx(
        dict(zip([s.name for s in inner.outputs], inner.to_numpy().outputs(0.2, x), strict=True))["error_x"]
    )


def test_two_closed_loops_of_one_kind_live_side_by_side(rng):
    both = interconnect([prefix(loop("one"), "one"), prefix(loop("two", 2.0), "two")])
    x = rng.normal(size=12)
    found = both.to_numpy().derivatives(0.7, x, (), {"two.plant.yaw_coulomb": 0.1})
    assert np.allclose(found[:6], loop("one").to_numpy().derivatives(0.7, x[:6]), atol=1e-12)
    assert np.allclose(
        found[6:],
        loop("two", 2.0).to_numpy().derivatives(0.7, x[6:], (), {"plant.yaw_coulomb": 0.1}),
        atol=1e-12,
    )


def test_signals_with_dots_are_passed_on_through_blocks_that_only_forward_them():
    s = Signal("s", "m", start=1.5)
    source = Block(
        "source",
        [s],
        [],
        [Signal("craft.x", "m")],
        derivatives={"s": sp.S.Zero},
        output_expressions={"craft.x": s.symbol},
    )
    cable = Block(
        "cable",
        inputs=[Signal("craft.x", "m")],
        outputs=[Signal("far", "m")],
        output_expressions={"far": Signal("craft.x").symbol},
    )
    meter = Block(
        "meter", [Signal("z", "m*s")], [Signal("far", "m")], derivatives={"z": Signal("far").symbol}
    )
    for blocks in ([source, cable, meter], [meter, cable, source]):
        whole = interconnect(blocks)
        at = [s.name for s in whole.states].index("meter.z")
        assert whole.to_numpy().derivatives(0.0, [s.start for s in whole.states])[at] == 1.5


def test_the_closed_loop_is_its_parts_evaluated_one_after_the_other(rng):
    craft = c17_simulation()
    reference, controller, plant = (
        ellipse(1.5, 2.5, -1, np.pi / 2),
        tracking_controller(craft),
        craft.plant(),
    )
    whole = interconnect([plant, reference, controller])
    for _ in range(100):
        t, x = rng.uniform(0, 10), rng.normal(0, 1.0, 6)
        r = reference.to_numpy().outputs(t, ())
        u = controller.to_numpy().outputs(t, (), [*x, *r])
        expected = plant.to_numpy().derivatives(t, x, u[:2])
        assert np.allclose(whole.to_numpy().derivatives(t, x), expected, rtol=1e-11, atol=1e-11)
        assert np.allclose(whole.to_numpy().outputs(t, x), [*x, *r, *u], rtol=1e-12, atol=1e-12)
