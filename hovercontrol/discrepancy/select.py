"""Which effects a model lacks: forward by score, confirmed by refitting, dropped, swapped, or not named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.candidates import Scored, Scores, Signatures, candidates, zoom
from hovercontrol.discrepancy.fit import Fit, fit, forced_states
from hovercontrol.discrepancy.ladder import rungs
from hovercontrol.discrepancy.noise import Noise, estimate
from hovercontrol.discrepancy.outliers import cleaned, without_outliers
from hovercontrol.discrepancy.probes import large_process
from hovercontrol.discrepancy.selection import Rival, Selection
from hovercontrol.discrepancy.weighing import (
    APART,
    EACH,
    EXPLAINED,
    LEAST,
    are_kin,
    by_chance,
    least_gain,
    less,
    top_gain,
    wald,
)
from hovercontrol.discrepancy.windowed import Data, Subject
from hovercontrol.effects import Shape
from hovercontrol.errors import InputError

Array = NDArray[np.float64]

#: Times at most that outliers are looked for: large ones hide small ones.
CLEANED = 3

#: chi2 per degree of freedom beyond which longer windows only get lost.
GROSS = 1.3

#: chi2 per degree of freedom at which an effect explains all: others with less of a score need no fit.
SETTLED = 1.03

#: Effects at most that are fitted to find the best.
MOST_TRIES = 4

#: How far a rival's score may lie behind the named effect's to be fitted in short windows, and the misfit it
#: may leave there to be fitted in long ones; in parts of the named effect's.
NEAR, CLOSE = 0.4, 0.05

#: Effects at most that are fitted in the place of a named one.
MOST_RIVALS = 8

#: Times at most that better effects are looked for in place of the named ones.
ROUNDS = 3

#: Effects at most that are fitted to stand for several.
FEW = 3

#: A smaller fall may as well be that of a fit that hung.
DOUBTFUL = 500.0

#: How much more than its due an effect must bring beside process noise that no score asked for.
FAR = 2.0

#: A rival that is ahead by this takes the name.
LEAD = 1.0


def select(
    model: Subject,
    data: Data,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    tell: Callable[[float, str], None] = lambda part, what: None,
) -> Selection:
    """Return which effects a model lacks.

    Parameters
    ----------
    model : Model or BlockModel
    data : Data
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
    tell : callable, optional
        Progress.
    """
    return _Search(model, data, names, max_effects, tell).run()


class _Search:
    """One search; `found` is where it stands."""

    def __init__(
        self,
        model: Subject,
        data: Data,
        names: Sequence[str] | None,
        max_effects: int,
        tell: Callable[[float, str], None],
    ) -> None:
        self.model, self.data, self.names, self.max_effects = model, data, names, max_effects
        self.rungs, self._tell = rungs(model, data), tell
        tell(0.05, "fitting the model as it is")
        base = fit(model, data, self.rungs[0])
        for _ in range(CLEANED):
            clean = without_outliers(base)
            if clean is None:
                break
            self.data = clean
            base = fit(model, clean, self.rungs[0], near=base)
        self.dirty = self.data is not data
        self.plain = base.noise
        self._tried: tuple[Scored, Fit] | None = None
        self.found = Selection(base, base)

    def run(self) -> Selection:
        """Search in short windows, then in longer ones; drop and swap."""
        found = self.found
        self._short()
        if found.final.noise.has_process and found.final.chi2_per_dof < EXPLAINED:
            found.final = self.fit(found.final.model, found.final, noise=self.plain)  # no gusts after all
        if not found.final.noise.has_process:
            self._climb()
            if found.final.chi2_per_dof > EXPLAINED and found.effects:
                self.swap()
                self._climb()
            if found.final.chi2_per_dof > EXPLAINED:
                self._once_more()
            self._settle()
        found.process = found.final.noise.has_process
        if found.process:
            found.slow = 0.0
        self._drop()
        self._simplify()
        for _ in range(ROUNDS):
            before = list(found.effects)
            found.rivals.clear()
            self.swap()
            if found.effects == before:
                break
            self._drop()  # with a better one in its place another may not be needed
        for name in list(found.effects):
            self._lead(name)
        return found

    def _settle(self) -> None:
        """Come to the long windows once more from short ones: some may hang where the craft sticks."""
        final = self.found.final
        if not self.found.effects or (final.converged and final.chi2_per_dof < SETTLED):
            return
        self.found.final = self._from_short(final)

    def _from_short(self, hung: Fit) -> Fit:
        """Return the better of a fit, taken to its end, and one that comes to its windows from short ones."""
        if not hung.converged:
            hung = self._ended(hung)
            if hung.converged and hung.chi2_per_dof < SETTLED:
                return hung
        if hung.windowed.length == self.rungs[0]:
            return hung
        new = fit(hung.model, self.data, self.rungs[0], self.plain, prior_model=self.model)
        for length in self.rungs[1:]:
            if length <= hung.windowed.length:
                new = self.fit(new.model, new, length=length)
        return min(hung, new, key=lambda f: f.cost)

    def _ended(self, found: Fit) -> Fit:
        """Return a fit that is taken to its end: kinks of dry friction may stop one before."""
        for _ in range(ROUNDS):
            if found.converged:
                break
            found = min(found, self.fit(found.model, found), key=lambda f: f.cost)
        return found

    def _once_more(self) -> None:
        """Begin again in short windows, where the way was lost in long ones, and climb with what is found."""
        found = self.found
        found.slow = found.final.chi2_per_dof
        before = list(found.effects)
        found.final = self.fit(found.final.model, found.final, length=self.rungs[0], noise=self.plain)
        self._short(always=True)
        if found.final.noise.has_process or found.effects == before:
            return
        short, named = found.final, list(found.effects)
        self._climb()
        if found.final.chi2_per_dof < EXPLAINED:
            found.slow = 0.0
        else:
            found.final, found.effects[:] = short, named

    def fit(
        self,
        model: Subject,
        near: Fit,
        *,
        length: float | None = None,
        noise: Noise | None = None,
        finer: int = 1,
    ) -> Fit:
        """Fit from where `near` ended, by default over windows and with noise like its own."""
        length = length or near.windowed.length
        noise = noise or near.noise
        return fit(model, self.data, length, noise, prior_model=self.model, near=near, finer=finer)

    def _scores(self, of: Fit) -> Scores:
        return Scores(of, Signatures(of, candidates(of, self.names)))

    def _progress(self, what: str) -> None:
        self._tell(0.1 + 0.7 * (1 - 0.6 ** (1 + len(self.found.steps))), what)

    def _short(self, always: bool = False) -> None:
        """Add effects in short windows as long as the misfit is gross, with process noise if that says more.

        With gusts the motion leaves the free run, and in long windows dry friction is then far from linear.
        Gusts that rival the model's own forces are the last resort: they would hide what is missing.
        """
        found = self.found
        while found.final.chi2_per_dof > EXPLAINED or always:
            current, self._tried = found.final, None
            signatures = Signatures(current, candidates(current, self.names))
            plain = Scores(current, signatures, self.plain)
            best = self._worth(plain, current.chi2_per_dof)
            noise = self.plain
            if not self.data.navigated and (always or not self._explains(current, plain, best)):
                self._progress("estimating process noise")
                gusty = noise_of(current)
                scores = Scores(current, signatures, gusty)
                with_gusts = self._worth(scores, 1.0)
                better = scores.cost - top_gain(with_gusts) < plain.cost - top_gain(best) - APART
                room = bool(best) and len(found.effects) < self.max_effects
                if better and room:
                    most = scores.cost - top_gain(with_gusts)
                    alone, added = self._add(current, best, most)  # far from linear, gusts outdo any score
                    if added:
                        found.final = alone
                        self._clean()
                        continue
                if better and not (room and large_process(current, gusty)):
                    noise, best = gusty, with_gusts
            if noise is not current.noise:
                current = self.fit(current.model, current, noise=noise)
            room = len(found.effects) < self.max_effects
            found.final, added = self._add(current, best) if room else (current, False)
            if not added and room and noise is not self.plain:
                found.final, added = self._again(current)
            if not added:
                return
            self._clean()

    def _again(self, current: Fit) -> tuple[Fit, bool]:
        """Try beside process noise what without it took most: no score tells what is far from linear."""
        if self._tried is None:
            return current, False
        scored, plain = self._tried
        self._tried = None
        new = self.fit(plain.model, plain, noise=current.noise)
        if current.cost - new.cost - by_chance(new, current) < FAR * least_gain(scored):
            return current, False
        return self._taken(scored, new)

    def _clean(self) -> None:
        """Leave out what stands out beside what was found so far: residuals of what lacks are as steep."""
        found = self.found
        clean = cleaned(found.final.model, self.data, self.rungs[:2]) if self.dirty else self.data
        if clean is self.data:
            return
        self.data, self.plain = clean, self.plain.but(measured=clean.noise)
        for name in ("base", "final"):
            old = getattr(found, name)
            noise = old.noise.but(measured=clean.noise)
            setattr(found, name, self.fit(old.model, old, noise=noise))

    def _explains(self, current: Fit, scores: Scores, best: Sequence[Scored]) -> bool:
        """Whether the best effect takes nearly all the misfit: process noise need not be thought of."""
        if not best:
            return False
        count = int(current.windowed.seen.sum())
        whole = count * (current.chi2_per_dof - 1.0)
        return best[0].gain > 0.8 * whole

    def _climb(self) -> None:
        """Add effects in longer and longer windows, where smaller ones show."""
        found = self.found
        for length in self.rungs:
            if length < found.final.windowed.length:
                continue
            if length > found.final.windowed.length:
                found.final = self._longer(found.final, length)
            last = length == self.rungs[-1]
            while len(found.effects) < self.max_effects and (last or found.final.chi2_per_dof > EXPLAINED):
                current = found.final
                best = self._worth(self._scores(current), current.chi2_per_dof)
                found.final, added = self._add(current, best)
                if not added:
                    break
                self._clean()
            if found.final.chi2_per_dof > GROSS:
                break

    def _longer(self, short: Fit, length: float) -> Fit:
        """Return a fit in longer windows; if they get lost, with what the short ones see already."""
        long = self._timed(self.fit(short.model, short, length=length))
        while (
            long.chi2_per_dof > EXPLAINED > short.chi2_per_dof and len(self.found.effects) < self.max_effects
        ):
            best = self._worth(self._scores(short), short.chi2_per_dof)
            short, added = self._add(short, best)
            if not added:
                break
            long = self._timed(self.fit(short.model, short, length=length))
        return long

    def _timed(self, found: Fit) -> Fit:
        """Return a fit with the time of each jump where a parabola through its cost is least.

        No slope leads there. Candidates have it to a row; half a row costs more than a small effect brings.
        """
        for e in found.model.effects:
            key = next((k for k, n in e.numbers.items() if isinstance(n, Shape) and n.of == "time"), None)
            if key is None:
                continue
            reach = 0.5 * float(np.median(found.response.dt))
            for _ in range(2):
                at = found.model.effect(e.name).values
                sides = [
                    self.fit(found.model.with_effects([type(e)(**{**at, key: at[key] + away})]), found)
                    for away in (-reach, reach)
                ]
                bend = sides[0].cost - 2.0 * found.cost + sides[1].cost
                away = 0.5 * reach * (sides[0].cost - sides[1].cost) / bend if bend > 0.0 else 0.0
                least = type(e)(**{**at, key: at[key] + float(np.clip(away, -2.0 * reach, 2.0 * reach))})
                found = min(
                    found, *sides, self.fit(found.model.with_effects([least]), found), key=lambda f: f.cost
                )
                reach *= 0.25
        return found

    def _worth(self, scores: Scores, chi2_per_dof: float) -> list[Scored]:
        """Return the effects whose gain is worth their numbers; note those that may not be."""
        best = scores.best()
        bar = max(1.0, chi2_per_dof)
        worth = [s for s in best if s.allowed and s.gain > least_gain(s) * bar]
        least = worth[0].gain if worth else 0.0
        for s in best:
            if not s.allowed and s.gain > max(least_gain(s) * bar, least):
                why = "fits best with a sign that its bounds forbid (a drag would feed energy)"
                if (s.candidate.name, why) not in self.found.rejected:
                    self.found.rejected.append((s.candidate.name, why))
        return worth

    def _add(self, current: Fit, worth: Sequence[Scored], most: float = np.inf) -> tuple[Fit, bool]:
        """Return the fit with the effect that takes most, and whether it takes enough, to a cost of `most`.

        Where the craft may stick or slip a fit can hang, and a coarse step costs likelihood: a small gain is
        counted again, in finer steps, from the best of three fits without the effect. They begin where that
        with it ended, in short windows, and at the coefficients given; from there that with it begins again.
        """
        tries: list[tuple[float, Scored, Fit]] = []
        for scored in worth[:MOST_TRIES]:
            explained = tries and min(t[2].chi2_per_dof for t in tries) < SETTLED
            kin = are_kin(scored.candidate.trial, worth[0].candidate.trial)
            if tries and scored.gain < (0.9 if explained and not kin else 0.4) * worth[0].gain:
                continue
            self._progress(f"trying {scored.candidate.name}")
            near = zoom(current, scored)
            new = self._timed(self.fit(current.model.with_effects([near.effect]), current))
            if not new.noise.has_process and not (new.converged and new.chi2_per_dof < SETTLED):
                new = self._from_short(new)
            tries.append((new.cost + by_chance(new, current), near, new))
        if not tries:
            return current, False
        cost, scored, new = min(tries, key=lambda t: t[0])
        if least_gain(scored) < current.cost - cost < DOUBTFUL:
            new = self.fit(new.model, new, finer=2)
            current = self.fit(current.model, new)
            if not current.noise.has_process:
                given = current.model.with_coefficients(self.model.coefficients())
                least = min(self._from_short(current), self.fit(given, current), key=lambda f: f.cost)
                least = self._ended(least)
                if least.cost < current.cost - 1.0:
                    added = new.model.effect(scored.candidate.name)
                    both = self._ended(self.fit(least.model.with_effects([added]), least))
                    current, new = least, min(new, both, key=lambda f: f.cost)
            cost = new.cost + by_chance(new, current)
        if not cost < min(current.cost - least_gain(scored), most):
            if not current.noise.has_process:
                self._tried = scored, new
            return current, False
        return self._taken(scored, new)

    def _taken(self, scored: Scored, new: Fit) -> tuple[Fit, bool]:
        self._tried = None
        self.found.steps.append((scored.candidate.name, scored.gain))
        self.found.effects.append(scored.candidate.name)
        return new, True

    def _drop(self) -> None:
        """Leave out what is not needed any more, and note what each effect brings."""
        found = self.found
        while found.effects:
            found.gains = {name: wald(found.final, name) for name in found.effects}
            weakest = min(found.gains, key=found.gains.__getitem__)
            if found.gains[weakest] > LEAST:
                return
            without = self.fit(less(found.final.model, weakest), found.final)
            bar = LEAST + EACH * len(found.final.model.effect(weakest).numbers)
            bar += by_chance(found.final, without)
            if not found.final.noise.has_process and without.cost - found.final.cost > bar:
                return  # far from linear: it says more than its standard errors tell
            found.effects.remove(weakest)
            found.final = without

    def _simplify(self) -> None:
        """Take one effect instead of several if it says nearly as much: two may share what one does alone."""
        found = self.found
        if len(found.effects) < 2:
            return
        self._progress("looking for one effect instead of several")
        final = found.final
        bare = less(final.model, *found.effects)
        try:
            alone = self.fit(bare, final)
        except InputError:  # without them it runs away in such windows: none alone will do
            return
        scores = self._scores(alone)
        for scored in self._worth(scores, 1.0)[:FEW]:
            if scored.gain < 0.5 * (alone.cost - final.cost):
                return
            one = self.fit(bare.with_effects([zoom(alone, scored).effect]), alone)
            if one.cost < final.cost + LEAST + by_chance(final, one):
                found.effects[:], found.final = [scored.candidate.name], one
                self._drop()
                return

    def _as_fine(self, one: Fit, other: Fit) -> Fit:
        """Return a fit in sub-steps no longer than another's: a coarse step costs likelihood."""
        finer = -(-other.windowed.pieces // one.windowed.pieces)
        return self.fit(one.model, one, finer=finer) if finer > 1 else one

    def swap(self) -> None:
        """Put other effects in the place of each; take a better one, note those that cannot be told apart."""
        found = self.found
        for name in list(found.effects):
            self._progress(f"looking for rivals of {name}")
            final = found.final
            bare_model = less(final.model, name)
            length = final.windowed.length
            slight = found.gains.get(name, np.inf) < DOUBTFUL  # short windows would not see it
            short = length if slight or final.noise.has_process else self.rungs[0]
            bare = self.fit(bare_model, final, length=short)
            whole = final if short == length else self.fit(final.model, final, length=short)
            scores = self._scores(bare)
            best = scores.best()
            top = next((s for s in best if s.candidate.name == name), None)
            if top is None:
                continue
            taken, left = bare.cost - whole.cost, MOST_RIVALS
            for scored in best:
                other_name = scored.candidate.name
                if other_name == name or other_name in found.effects or not scored.allowed or not left:
                    continue
                far = top.gain - scored.gain > max(3 * APART, NEAR * top.gain)
                if far and not are_kin(scored.candidate.trial, top.candidate.trial):
                    continue
                left -= 1
                near = self.fit(bare_model.with_effects([zoom(bare, scored).effect]), bare)
                if near.cost - whole.cost > APART + CLOSE * taken:
                    continue
                other = near if short == length else self.fit(near.model, near, length=length)
                if abs(other.cost - found.final.cost) < DOUBTFUL:
                    other = self._as_fine(other, found.final)
                    found.final = self._as_fine(found.final, other)
                behind = other.cost - found.final.cost
                correlation = scores.correlation(scored.columns, top.columns)
                if behind < -APART:
                    found.effects[found.effects.index(name)] = other_name
                    found.final, name = other, other_name
                    found.rivals = [r for r in found.rivals if r.instead_of in found.effects]
                elif behind < APART:
                    found.rivals.append(Rival(other_name, name, float(behind), correlation, other.model))

    def _lead(self, name: str) -> None:
        """Name the likeliest of an effect and its rivals, if the logs tell its size."""
        found = self.found
        first = min((r for r in found.rivals if r.instead_of == name), key=lambda r: r.behind, default=None)
        if first is None or first.behind > -LEAD:
            return
        ahead = self.fit(first.model, found.final)
        gain, won = wald(ahead, first.name), found.final.cost - ahead.cost
        if gain < LEAST or won <= 0.0:
            return
        second = Rival(name, first.name, won, first.correlation, found.final.model)
        others = [
            replace(r, instead_of=first.name if r.instead_of == name else r.instead_of, behind=r.behind + won)
            for r in found.rivals
            if r is not first
        ]
        found.rivals[:] = [second, *(r for r in others if r.behind < APART)]
        found.effects[found.effects.index(name)] = first.name
        del found.gains[name]
        found.final, found.gains[first.name] = ahead, gain


def noise_of(f: Fit, *, rough: bool = False) -> Noise:
    """Return the noise that fits the residuals of a fit best, process noise included.

    Roughly, and faster, the unknowns stay.
    """
    w = f.windowed
    columns = np.concatenate([f.left[..., None], f.moves if rough else f.jacobian], axis=-1)
    return estimate(columns, w.seen, len(w.free), f.noise, f.response, forced_states(f), rough=rough)[0]
