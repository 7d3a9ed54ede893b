"""What the samples of :mod:`benchmarks.monitor_unknown` show to an observer who knows the cause.

An extended Kalman filter, which shares no code with the monitor's, follows each run from the onset to 5 s
after the alarm: once with the true change, and once with each of the three candidates of most evidence, all
at their likeliest sizes. Twice the logarithm of the likelihood ratio of the truth to the best candidate
bounds what a monitor may say: below 2 ln 100 even the truth does not refute that candidate at 100 to 1.

``python -m benchmarks.monitor_bound RUNS MACHINE ...`` simulates RUNS for each change (4) of machines (all).
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from benchmarks.monitor_sizes import MACHINES, ONSET, PERIOD, Machine
from benchmarks.monitor_unknown import CHANGES, judged
from hovercontrol.blocks.sgn import regularise
from hovercontrol.craft.models.interface import as_model

Array = NDArray[np.float64]
DECIDES = 2.0 * np.log(100.0)
#: Runge-Kutta steps in a tick, and the step of the derivatives.
STEPS, SMALL = 2, 1e-6


class Filter:
    """A machine with one change of the size q: ``x' = f(x, u, q)``, ``y = x`` but for an error of a sensor.

    Parameters
    ----------
    change : str
        As for :func:`benchmarks.monitor_sizes.runs_of`; "" for none.
    """

    def __init__(self, machine: Machine, change: str) -> None:
        model, q = as_model(machine.model), sp.Symbol("q_", real=True)
        own = {model.coefficient_name(key): key.rpartition(".")[2] for key in model.coefficients()}
        plant, self.change, self.known, varied = model.plant(), change, 0.0, None
        if change in own:
            varied = next(p for p in plant.parameters if p.name.endswith(own[change]))
            self.known = float(varied.start)
        elif change and not change.startswith("push_") and not change.endswith(("_bias", "_scale")):
            cls = model.effect_class(change)
            number = next(k for k, n in cls.numbers.items() if not np.isnan(n.neutral))
            effect = cls(**{number: 0.1})
            plant = model.with_effects([effect]).plant()
            varied = plant.parameter(effect.parameter(number))
        values = {p.symbol: sp.Float(float(p.start)) for p in plant.parameters}
        values |= {varied.symbol: q} if varied else {}
        rates = {k: regularise(plant.expand(e)).xreplace(values) for k, e in plant.derivatives.items()}
        if change.startswith("push_"):
            rates[change[5:]] += q
        self.names, self.inputs = [s.name for s in plant.states], [s.name for s in plant.inputs]
        symbols = [[s.symbol for s in plant.states], [s.symbol for s in plant.inputs], q]
        self._f = sp.lambdify(symbols, [rates[n] for n in self.names], "numpy", cse=True)
        self._noise = {n: std**2 for n, std in machine.noise.items()}
        self._walk = np.diag([machine.process.get(n, 0.0) ** 2 * PERIOD for n in self.names])
        self.start = np.array([float(s.start) for s in plant.states])

    def _rates(self, x: Array, u: Sequence[float], q: float) -> Array:
        return np.array([np.broadcast_to(e, x.shape[1:]) for e in self._f(list(x), list(u), q)])

    def follow(
        self, data: Mapping[str, Array], ticks: range, x: Array, P: Array, size: float
    ) -> tuple[float, Array, Array]:
        """Return twice the log-likelihood of the samples of these ticks, and the prediction after them."""
        q, n, twice = self.known + size, len(x), 0.0
        for k in ticks:
            for name, variance in self._noise.items():
                H, off = np.zeros(n), size if self.change == f"{name}_bias" else 0.0
                H[self.names.index(name)] = 1.0 + (size if self.change == f"{name}_scale" else 0.0)
                S, e = H @ P @ H + variance, data[name][k] - H @ x - off
                twice -= e**2 / S + np.log(S)
                K = P @ H / S
                x, P = x + K * e, P - np.outer(K, H @ P)
            u, h = [data[i][k] for i in self.inputs], PERIOD / STEPS
            X = np.column_stack([x, x[:, None] + SMALL * np.eye(n)])
            for _ in range(STEPS):
                a = self._rates(X, u, q)
                b = self._rates(X + h / 2 * a, u, q)
                c = self._rates(X + h / 2 * b, u, q)
                X = X + h / 6 * (a + 2 * b + 2 * c + self._rates(X + h * c, u, q))
            x, Phi = X[:, 0], (X[:, 1:] - X[:, :1]) / SMALL
            P = Phi @ (P + self._walk / 2) @ Phi.T + self._walk / 2
        return twice, x, P

    def likeliest(self, data: Mapping[str, Array], ticks: range, x: Array, P: Array, guess: float) -> float:
        """Return twice the log-likelihood at the likeliest size; a lag begins at its command."""
        late = [n for n in self.names if n.endswith("_lagged")]
        x = np.append(
            x, [data[next(i for i in self.inputs if n.endswith(f"{i}_lagged"))][ticks[0] - 1] for n in late]
        )
        P = np.pad(P, (0, len(late)))

        def against(size: float) -> float:
            value = -self.follow(data, ticks, x, P, size)[0]
            return value if np.isfinite(value) else 1e12

        if late or self.change.endswith("_deadzone"):
            found = minimize_scalar(against, bounds=(0.01, 1.0), method="bounded", options={"xatol": 1e-3})
        else:
            found = minimize_scalar(
                against, bracket=(0.6 * guess, guess), options={"xtol": 1e-3, "maxiter": 25}
            )
        return -float(found.fun)


def bounds(label: str, runs: int) -> Iterator[tuple[str, float, str]]:
    """Yield each run in which a change is found: what it is, how far the truth is ahead, what is said."""
    machine = MACHINES[label](True)
    filters = {name: Filter(machine, name) for name in ["", *CHANGES[label], *machine.changes]}
    none, onset = filters[""], round(ONSET / PERIOD)
    for run in judged(label, machine, runs):
        if run.kind == "none":
            continue
        _, x, P = none.follow(run.data, range(onset), none.start, 0.01 * np.eye(none.start.size), 0.0)
        ticks, evidence = (
            range(onset, run.tick),
            {c: run.out[f"evidence_{c}"][run.tick] for c in machine.changes},
        )
        guess = {c: 0.3 * sizes[1] for c, sizes in machine.changes.items()}
        guess[run.found] = float(run.out["change"][run.tick])
        first = sorted(evidence, key=lambda c: -evidence[c])[:3]
        truth = filters[run.name].likeliest(run.data, ticks, x, P, run.size)
        best = max(filters[c].likeliest(run.data, ticks, x, P, guess[c]) for c in first)
        yield f"{label}, {run.name} {run.size:g}", truth - best, run.kind


def rows(runs: int = 4, machines: Sequence[str] = ()) -> Iterator[tuple[str, str, str, bool | None]]:
    total: Counter[tuple[str, bool]] = Counter()
    for label in machines or MACHINES:
        for change, ahead, kind in bounds(label, runs):
            total[kind, ahead > DECIDES] += 1
            text = f"the truth is ahead by {ahead:.1f} (2 ln 100 = {DECIDES:.1f}); said: {kind}"
            yield change, text, "", None
    said = {"unknown": "unknown", "or": "a name or unknown", "ALONE": "a wrong name alone"}
    for kind, text in said.items():
        yield f"{text}: truth ahead, not ahead", f"{total[kind, True]}, {total[kind, False]}", "", None


if __name__ == "__main__":
    given = sys.argv[1:]
    for row in rows(int(given[0]) if given else 4, given[1:]):
        print(*row, flush=True)
