"""Does the proposed experiment settle an ambiguous diagnosis rightly?

``python -m benchmarks.next_experiment [--cases 20] [--seed 0]``: the benchmark's machines, each with an
effect or a law missing, driven so briefly that `diagnose` finds several readings. The proposed experiment is
simulated and both logs are diagnosed, twice at most. Beside it, random steps of the same length in the range
that proposals may use.

Settled rightly: the verdict is ``effect``, and the only name is the effect or the law that is missing.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import sympy as sp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.benchmark.cases import expression_of, law_name, law_unit, steps, with_rates
from hovercontrol.identification.benchmark.machines import MACHINES, Machine
from hovercontrol.identification.benchmark.scoring import effect_terms, ratio
from hovercontrol.identification.diagnose.diagnosis import Diagnosis
from hovercontrol.identification.diagnose.experiment.proposal import Experiment

SEED = 58_2811

#: Part of the range of commands in the first log, its rows, and the relative size of what is missing.
GENTLE, ROWS, PART = (0.4, 0.8), 200, (0.5, 1.0)

Array = np.ndarray


def bounded(kind: Machine) -> Model | BlockModel:
    """A machine's model whose commands have the bounds of the benchmark."""
    model = kind.model()
    if not isinstance(model, BlockModel):
        return model
    inputs = tuple(
        replace(s, lower=kind.commands[s.name][0], upper=kind.commands[s.name][1]) for s in model.block.inputs
    )
    return replace(model, block=replace(model.block, inputs=inputs))


class Hidden:
    """A machine, and what its model lacks."""

    def __init__(self, machine: str, rng: np.random.Generator) -> None:
        self.kind, self.machine, self.rng = MACHINES[machine], machine, rng
        model = bounded(self.kind)

        def drawn(model: Model | BlockModel, part: float) -> Model | BlockModel:
            return model.with_coefficients({
                k: v if k.endswith("_width") else v * float(rng.uniform(1.0 - part, 1.0 + part))
                for k, v in model.coefficients().items()
            })  # fmt: skip

        self.true = drawn(model, 0.2)
        self.given = drawn(self.true, 0.03)
        every = [*self.kind.effects, *self.kind.laws]
        what, part = every[int(rng.integers(len(every)))], float(rng.uniform(*PART))
        self.name, self.terms = (
            (what, dict[str, sp.Expr]()) if isinstance(what, str) else (law_name(*what), {})
        )
        if isinstance(what, str):
            values = {k: part * float(rng.uniform(*span)) for k, span in self.kind.effects[what].items()}
            self.plant = self.true.with_effects([self.true.effect_class(what)(**values)]).plant()
            self.terms = effect_terms(self.given, self.true.effect_class(what))
        else:
            (equation, text), plant = what, self.true.plant()
            term = expression_of(text, plant)
            size = part * float(rng.uniform(*self.kind.laws[what]))
            c = hc.Signal("hidden_law", law_unit(equation, term, plant), start=size)
            rates = {**plant.derivatives, equation: plant.derivatives[equation] - c.symbol * term}
            self.plant, self.terms = with_rates(plant, rates, parameters=(c,)), {equation: term}

    def log(self, name: str, t: Array, commands: dict[str, Array]) -> hc.Log:
        """A log of the true machine."""
        run = self.plant.compile(friction="smooth").simulate(t, commands, rtol=1e-7, atol=1e-9)
        rows = dict(zip((s.name for s in self.plant.states), np.atleast_2d(run.states), strict=True))
        noise = {c: size * self.rng.normal(size=t.size) for c, size in self.kind.noise.items()}
        return hc.Log(name, t, {**{c: rows[c] + e for c, e in noise.items()}, **commands})

    def steps(self, t: Array, part: float) -> dict[str, Array]:
        """Random steps within a part of the range of commands."""
        own = self.kind
        return {
            k: steps(self.rng, t.size, float(t[1] - t[0]), own.hold, (part * low, part * high))
            for k, (low, high) in own.commands.items()
        }

    def settled(self, found: Diagnosis) -> bool:
        """Whether a diagnosis names what is missing, and nothing else."""
        names = list(dict.fromkeys(e.effect for e in found.effects))
        if found.verdict != "effect" or len(names) != 1:
            return False
        if names[0] == self.name:
            return True
        terms = effect_terms(self.given, type(found.amended.effect(names[0])))
        return terms.keys() == self.terms.keys() and all(ratio(e, self.terms[k]) for k, e in terms.items())


def ambiguous(seed: int) -> Iterator[tuple[Hidden, hc.Log, Diagnosis]]:
    """Machines whose diagnosis is ambiguous, with the log, without end."""
    while True:
        rng, seed = np.random.default_rng([SEED, seed]), seed + 1
        hidden = Hidden(list(MACHINES)[int(rng.integers(len(MACHINES)))], rng)
        t = hidden.kind.dt * np.arange(ROWS)
        log = hidden.log("first", t, hidden.steps(t, float(rng.uniform(*GENTLE))))
        try:
            found = hc.diagnose(hidden.given, [log])
        except InputError as error:
            print(f"    {seed - 1} {hidden.machine}, {hidden.name}: refused: {error}", flush=True)
            continue
        if found.verdict == "ambiguous":
            print(f"case of seed {seed - 1}: {hidden.machine} lacks {hidden.name}: {text(found)}", flush=True)
            yield hidden, log, found


def text(found: Diagnosis) -> str:
    names = ", ".join(dict.fromkeys(e.effect for e in found.effects))
    rivals = f" or {', '.join(r.name for r in found.rivals)}" if found.rivals else ""
    return f"{found.verdict} ({names or 'nothing'}{rivals})"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    after, chance, none, said, begin = [0, 0], 0, 0, list[float](), time.process_time()
    cases = ambiguous(options.seed)
    for _ in range(options.cases):
        hidden, log, _ = next(cases)
        lengths = list[Array]()

        def fly(e: Experiment) -> hc.Log:
            said.append(e.sure)
            lengths.append(e.time)  # noqa: B023
            return hidden.log(f"flight {len(lengths)}", e.time, dict(e.commands))  # noqa: B023

        found = hc.experiment(hidden.given, [log], fly=fly, flights=2)
        right = [hidden.settled(d) for d in found.diagnoses]
        after[0] += any(right[1:2])
        after[1] += any(right[1:])
        for e, d in zip(found.experiments, found.diagnoses[1:], strict=True):
            print(f"    {e.name}, {e.time[-1]:.3g} s, {e.sure:.0%} sure: {text(d)}", flush=True)
        if not lengths:
            none += 1
            print(f"    no proposal: {found.diagnosis.advice}", flush=True)
            continue
        t = lengths[0]
        d = hc.diagnose(hidden.given, [log, hidden.log("random", t, hidden.steps(t, 1.0))])
        chance += hidden.settled(d)
        print(f"    settled rightly {right[1:]}; random steps of {t[-1]:.3g} s: {text(d)}", flush=True)
    print(f"{options.cases} ambiguous: settled rightly by one experiment {after[0]}, by two {after[1]}")
    print(f"by random steps of the same length {chance}; without a proposal {none}")
    if said:
        print(f"stated beforehand: {np.nanmean(said):.0%} sure")
    print(f"{(time.process_time() - begin) / options.cases:.0f} s of processor time a case")


if __name__ == "__main__":
    main()
