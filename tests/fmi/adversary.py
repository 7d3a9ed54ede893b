"""An importer that calls an FMU in every order that the standard permits, at random, and its model.

The model is a mass on a rough floor, pushed by an input that jumps and by a sampled controller::

    x' = v,  v' = F + h - mu sgn v,  h = -4 x - v at every tick of 0.1 s

Between events v is linear and x quadratic in time, so that any step of RK4 is exact: importers may choose
steps as they like and must all arrive at the same numbers. :func:`by_hand` computes them without any FMU.
"""

import ctypes
import math
from dataclasses import dataclass

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

import hovercontrol as hc
from hovercontrol.blocks.sgn import sgn

MU, PERIOD, END = 0.8, 0.1, 1.0
#: Times and values of the force, from each time on. It breaks the mass away from rest, and reverses it.
PUSHES = ((0.0, 0.5), (0.13, 2.5), (0.3, -1.8), (0.62, 1.4), (0.8, -0.9))
SAMPLES = (0.25, 0.5, 0.75, END)


def sled():
    """Return the model as a hybrid Block."""
    x, v, F, h = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2"), hc.Signal("h", "m/s^2")
    mu, width = hc.Signal("mu", "m/s^2", start=MU), hc.Signal("width", "m/s", start=1e-3)
    k, d = hc.Signal("k", "1/s^2", start=4.0), hc.Signal("d", "1/s", start=1.0)
    push = F.symbol + h.symbol - mu.symbol * sgn(v.symbol, width.symbol)
    rates = {"x": v.symbol, "v": push}
    mass = hc.Block("mass", [x, v], [F, h], [x, v], [mu, width], rates)
    law = {"h": -k.symbol * x.symbol - d.symbol * v.symbol}
    pilot = hc.Block("pilot", [], [x, v], [h], [k, d], {}, law, period=PERIOD)
    return hc.interconnect([mass, pilot], "sled", inputs=["F"], outputs=["x", "v"])


def by_hand():
    """Return x and v at the samples: parabolas between events."""
    marks = sorted({*(t for t, _ in PUSHES), *SAMPLES, *(PERIOD * k for k in range(11))})
    t = x = v = h = 0.0
    found = []
    for k, mark in enumerate(marks):
        while t < mark:
            force = [value for at, value in PUSHES if at <= t + 1e-12][-1] + h
            if v == 0.0:
                a = 0.0 if abs(force) <= MU else force - math.copysign(MU, force)
            else:
                a = force - math.copysign(MU, v)
            length = mark - t
            if v * a < 0.0 and -v / a <= length:  # it comes to rest first
                length = -v / a
                x, v, t = x + v * length + 0.5 * a * length**2, 0.0, t + length
                continue
            x, v, t = x + v * length + 0.5 * a * length**2, v + a * length, mark
        if any(abs(mark - PERIOD * n) < 1e-12 for n in range(11)):
            h = -4.0 * x - v
        if mark in SAMPLES:
            found.append((x, v))
        assert k < len(marks)
    return np.array(found)


@dataclass
class Adversary:
    """Random, permitted calls of one FMU.

    Parameters
    ----------
    path : path
        The FMU of :func:`sled` with friction="events".
    seed : int
    """

    path: str
    seed: int

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        self.described = read_model_description(self.path, validate=False)
        self.two = self.described.fmiVersion == "2.0"
        self.references = {v.name: v.valueReference for v in self.described.modelVariables}
        self.calls = 0

    def chance(self, p=0.3):
        self.calls += 1
        return self.rng.random() < p

    def set(self, fmu, force):
        (fmu.setReal if self.two else fmu.setFloat64)([self.references["F"]], [force])

    def get(self, fmu):
        values = (fmu.getReal if self.two else fmu.getFloat64)([self.references[n] for n in ("x", "v")])
        return tuple(values)

    def around_a_state(self, fmu, nonsense):
        """Save the state, do nonsense, and go back, perhaps by way of bytes."""
        state = fmu.getFMUState()
        if self.chance():
            data, old = fmu.serializeFMUState(state), state
            state = fmu.deserializeFMUState(data)
            fmu.freeFMUState(old)
        nonsense()
        fmu.setFMUState(state)
        fmu.freeFMUState(state)

    # ---- Model Exchange ----

    def exchange(self, folder):
        """Return x and v at the samples, integrated here."""
        fmu = (FMU2Model if self.two else FMU3Model)(
            guid=self.described.guid,
            unzipDirectory=folder,
            modelIdentifier=self.described.modelExchange.modelIdentifier,
            instanceName="sled",
        )
        fmu.instantiate()
        if self.chance():  # a run that is given up
            self._begin(fmu)
            fmu.reset()
        self._begin(fmu)
        self.fmu = fmu
        found = [self._until(mark) for mark in SAMPLES]
        fmu.terminate()
        fmu.freeInstance()
        return np.array(found)

    def _begin(self, fmu):
        if self.two:
            fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        self.set(fmu, PUSHES[0][1])
        if self.chance():
            self.get(fmu)
        fmu.exitInitializationMode()
        self.fmu, self.t, self.force = fmu, 0.0, PUSHES[0][1]
        self._update()

    def _update(self):
        fmu = self.fmu
        for _ in range(1 + 2 * self.chance()):
            *_, has_next, following = fmu.newDiscreteStates() if self.two else fmu.updateDiscreteStates()
        self.next = following if has_next else math.inf
        if self.chance():
            self.get(fmu)
        fmu.enterContinuousTimeMode()
        x = (ctypes.c_double * 2)()
        fmu.getContinuousStates(x, 2)
        self.x = np.array(x)

    def _event(self, force=None):
        self.fmu.enterEventMode()
        if force is not None:
            self.force = force
            self.set(self.fmu, force)
        self._update()

    def _at(self, t, x, force=None):
        self.fmu.setTime(t)
        self.fmu.setContinuousStates((ctypes.c_double * 2)(*x), 2)
        if force is not None:
            self.set(self.fmu, force)

    def _rates(self, t, x):
        self._at(t, x)
        f = (ctypes.c_double * 2)()
        (self.fmu.getDerivatives if self.two else self.fmu.getContinuousStateDerivatives)(f, 2)
        return np.array(f)

    def _indicator(self, t, x):
        self._at(t, x)
        z = (ctypes.c_double * 1)()
        self.fmu.getEventIndicators(z, 1)
        return z[0]

    def _rk4(self, h):
        t, x = self.t, self.x
        a = self._rates(t, x)
        b = self._rates(t + h / 2, x + h / 2 * a)
        c = self._rates(t + h / 2, x + h / 2 * b)
        d = self._rates(t + h, x + h * c)
        return x + h / 6 * (a + 2 * b + 2 * c + d)

    def _disturb(self, h):
        """Do what an importer may do between two steps, and come back to the same point."""
        fmu, rng = self.fmu, self.rng
        if self.chance():  # a rejected step, with another input
            self._at(self.t + h * rng.random(), rng.normal(size=2), rng.normal())
            self.get(fmu)
            self._at(self.t, self.x, self.force)
        if self.chance():
            fmu.getNominalsOfContinuousStates((ctypes.c_double * 2)(), 2)
            more = () if self.two else (1,)
            rate = self.described.derivatives[-1].variable.valueReference
            fmu.getDirectionalDerivative([rate], [self.references["F"]], [1.0], *more)
        if self.chance(0.2):

            def nonsense():
                self._at(self.t + h, rng.normal(size=2), rng.normal())
                if fmu.completedIntegratorStep()[0] or self.chance():
                    fmu.enterEventMode()
                    (fmu.newDiscreteStates if self.two else fmu.updateDiscreteStates)()
                    if self.chance():
                        fmu.enterContinuousTimeMode()

            self.around_a_state(fmu, nonsense)
        if self.chance(0.2):  # an event for nothing
            self._at(self.t, self.x)
            self._event()

    def _until(self, mark):
        """Integrate to a time; return x and v there."""
        while self.t < mark - 1e-12:
            jumps = [t for t, _ in PUSHES if t > self.t + 1e-12]
            bound = min([mark, self.next, *jumps])
            h = bound - self.t
            self._disturb(h)
            if self.chance(0.5):
                h *= self.rng.uniform(0.05, 1.0)
            end = bound if h == bound - self.t else self.t + h
            if h > 1e-12:
                self._step(h, end)
            else:
                self._at(end, self.x)
                self.t = end
            if self.t == bound:
                due = [value for t, value in PUSHES if t == bound]
                if due and self.chance(0.5):  # as some tools do: the input jumps without an event
                    self.force = due[0]
                    self.set(self.fmu, self.force)
                    if self.fmu.completedIntegratorStep()[0]:
                        self._event()
                elif due or self.next <= self.t:
                    self._event(due[0] if due else None)
        self._at(self.t, self.x)
        return self.get(self.fmu)

    def _step(self, h, end):
        """Take a step, shortened to the first change of the indicator's sign in it."""
        x, before = self._rk4(h), self._indicator(self.t, self.x) > 0.0
        crossed = (self._indicator(end, x) > 0.0) != before
        if crossed:
            low, high = 0.0, h
            while high - low > 1e-14:
                middle = 0.5 * (low + high)
                if (self._indicator(self.t + middle, self._rk4(middle)) > 0.0) == before:
                    low = middle
                else:
                    high = middle
            x, end = self._rk4(high), self.t + high
        self.x, self.t = x, end
        self._at(end, x)
        prior = () if self.chance() else (False,)
        if self.fmu.completedIntegratorStep(*prior)[0] or crossed:
            self._event()

    # ---- Co-Simulation ----

    def cosim(self, folder):
        """Return x and v at the samples, integrated by the FMU."""
        fmu = (FMU2Slave if self.two else FMU3Slave)(
            guid=self.described.guid,
            unzipDirectory=folder,
            modelIdentifier=self.described.coSimulation.modelIdentifier,
            instanceName="sled",
        )
        self.fmu, self.events, early = (
            fmu,
            not self.two and self.chance(0.5),
            not self.two and self.chance(0.5),
        )
        options = {} if self.two else {"eventModeUsed": self.events, "earlyReturnAllowed": early}
        if not self.two and self.chance(0.5):
            options["intermediateUpdate"] = self._intermediate
        fmu.instantiate(**options)
        for _ in range(1 + self.chance()):
            fmu.reset()
            if self.two:
                fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            self.set(fmu, PUSHES[0][1])
            fmu.exitInitializationMode()
        if self.events:
            self._updated()
        found, self.t = [], 0.0
        marks = sorted({*SAMPLES, *(t for t, _ in PUSHES[1:])})
        for mark in marks:
            while self.t < mark - 1e-12:
                self._do_step(mark)
            due = [value for t, value in PUSHES if t == mark]
            if mark in SAMPLES:
                found.append(self.get(fmu))
            if due:
                if self.events and self.chance(0.5):
                    fmu.enterEventMode()
                    self.set(fmu, due[0])
                    self._updated()
                else:
                    self.set(fmu, due[0])
        fmu.terminate()
        fmu.freeInstance()
        return np.array(found)

    def _updated(self):
        for _ in range(1 + self.chance()):
            self.fmu.updateDiscreteStates()
        self.fmu.enterStepMode()

    def _do_step(self, mark):
        fmu = self.fmu
        h = (mark - self.t) * (self.rng.uniform(0.05, 1.0) if self.chance(0.6) else 1.0)
        # a point within 1e-6 of the period from a tick is at the tick
        end = mark if mark - self.t - h < 1e-6 * PERIOD else self.t + h
        h = end - self.t
        if self.chance(0.2):

            def nonsense():
                self.set(fmu, self.rng.normal())
                fmu.doStep(self.t, h, False)

            self.around_a_state(fmu, nonsense)
        if self.chance():
            self.get(fmu)
        found = fmu.doStep(self.t, h, self.chance(0.3) and False)
        if self.two:
            self.t = end
            return
        event, _, early, reached = found
        self.t = reached if early else end
        if event or (self.events and self.chance(0.2)):
            fmu.enterEventMode()
            self._updated()

    def _intermediate(
        self, _environment, time, _can_set, can_get, _finished, can_return, wants_return, return_time
    ):
        if can_get and self.chance():
            self.get(self.fmu)
        wants_return[0] = bool(can_return) and bool(self.chance(0.2))
        return_time[0] = time


def worst(path, seeds):
    """Return the largest deviation from :func:`by_hand`, and the number of choices, with these seeds."""
    folder, want = extract(str(path)), by_hand()
    most, calls = 0.0, 0
    for seed in seeds:
        for kind in ("exchange", "cosim"):
            run = Adversary(str(path), seed)
            off = float(np.abs(getattr(run, kind)(folder) - want).max())
            most, calls = max(most, off), calls + run.calls
            if off > 1e-9:
                raise AssertionError(f"{path}, {kind}, seed {seed}: off by {off:.3g}")
    return most, calls
