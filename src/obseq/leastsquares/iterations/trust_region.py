"""Iterations that never accept a worse sum of squares: steps within a radius that follows their gains."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import DivergenceError, SingularSystemError
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.iterations.arrival import (
    NEGLIGIBLE,
    Arrival,
    Options,
    resolution,
    rounding_of_cost,
    rounding_of_sum,
)
from obseq.leastsquares.iterations.gauss_newton import Progress, recorded, strayed
from obseq.leastsquares.iterations.overshoot import Overshoot
from obseq.leastsquares.iterations.trail import Trail
from obseq.leastsquares.iterations.trials import Path, Trial, gain_of, scaled, share_of
from obseq.leastsquares.iterations.violation import Violation
from obseq.leastsquares.solution.result import Iteration, StopReason

LEAST_GAIN = 1e-4
"""Share of the promised decrease of the cost that a step must bring to be accepted."""

POOR, GOOD = 0.25, 0.75
"""Gains below which the radius shrinks, and from which it grows."""

MOST_TRIALS = 60
"""Trials of one iteration: the radius has then shrunk beyond any use."""

FIRST_RADIUS = 1.0
"""First radius, as a multiple of the size of the unknowns; a first step as good as promised may be longer."""

FASTEST = 2.0
"""Gain from which on the radius grows no faster: four times the step."""

PATIENCE = 3
"""Steps taken in the dark, none of them half as long as the one before, after which the iterations end."""

SWINGS = 4
"""Full steps of poor gain one after the other, swinging about a minimum, after which they are held back."""

EXCURSION = 3
"""Full steps that an excursion may take until it is below where it began."""

STEEPEST = 1e3
"""Rise of the cost, as a factor, at which an excursion turns back."""

NEARBY = 0.3
"""Share of the cost that a full step promises, below which a rise is the bend of weak directions."""

LANDING = 2
"""Steps that a leap may take back to the bottom of the valley."""

WORTHWHILE = 0.9
"""Share of the cost below which an excursion must come, or..."""

AHEAD = 8.0
"""...the number of steps like the last one that it must be worth."""

FIRST_EXCURSION = 8
"""Restrained steps one after the other that prompt an excursion; twice as many after one in vain."""


def iterate_in_region(
    equations: NormalEquations,
    path: Path,
    options: Options,
    redundancy: int,
    before: Callable[[int], None],
    progress: Callable[[Iteration], None],
) -> Progress:
    """Runs the iterations; the table of unknowns holds the last accepted state whatever happens.

    What was found stays: unknowns that are not determined any more where the steps have led are told in the
    progress.

    Raises:
        SingularSystemError: the unknowns are not determined where the iterations start.
    """
    done, counted = Progress(), equations.evaluations
    search = _Search(equations, path, options, redundancy)
    for number in range(options.max_iterations):
        before(number)
        try:
            trial, reason = search.advance()
        except SingularSystemError as error:
            if not done.iterations:
                raise
            done.weak, done.reason = strayed(error, done.iterations), StopReason.NO_DECREASE
            break
        record = recorded(trial.linearisation, options, redundancy + path.defect, trial.move, trial.length)
        done.iterations.append(record)
        progress(record)
        if reason is not None:
            done.reason = reason
            done.weak = _settled(path, done.iterations)
            break
    done.defect, done.evaluations = path.defect, equations.evaluations - counted - search.known
    return done


def _settled(path: Path, iterations: list[Iteration]) -> SingularSystemError | None:
    """Counts the defect; what is hardly determined where the iterations have arrived."""
    try:
        path.settle()
    except SingularSystemError as error:
        return strayed(error, iterations)
    return None


class _Search:
    """The state of the iterations: the radius, and what was tried of late.

    Attributes:
        known: how often residuals were computed where they had been: all linearisations but the first.
    """

    def __init__(self, equations: NormalEquations, path: Path, options: Options, redundancy: int) -> None:
        self._equations = equations
        self._path = path
        self._arrival = Arrival(equations, options.tolerance)
        self._redundancy, self._tolerance = redundancy, options.tolerance
        self._radius = path.radius
        self._overshoot = Overshoot()
        self._is_first, self._decrease, self._poor = not path.is_bold, np.inf, 0
        self._dark_length, self._in_the_dark = np.inf, 0
        self._restrained, self._prompt, self._chances = 0, FIRST_EXCURSION, EXCURSION
        self._trail = Trail()
        self._violation: Violation | None = None
        self.known = -1

    def advance(self) -> tuple[Trial, StopReason | None]:
        """One iteration: the unknowns have moved by an accepted step, or are where they were."""
        self._linearise()
        trial = self._path.within(self._radius)
        self._note_violation(trial.linearisation.diagonal)
        reason = self._arrived(trial)
        if reason is not None:
            self._equations.table.move(trial.move)
            return trial, reason
        if self._trail.prompts:
            if self._leap(trial.linearisation.cost):
                return trial, None
            trial = self._path.within(self._radius)
        if self._restrained >= self._prompt:
            if self._excursion(self._path.full()):
                self._trail = Trail()
                return trial, None
            trial = self._path.within(self._radius)
        taken, reason = self._accepted(self._stretched(trial))
        if taken is not trial or not trial.is_full:
            self._arrival.interrupt()
        return taken, reason

    def _linearise(self, in_passing: bool = False) -> None:
        self.known += 1
        self._path.linearise(in_passing)

    def _stretched(self, trial: Trial) -> Trial:
        """The share of a full step that the last two make known, where residuals are what is left."""
        linearisation = trial.linearisation
        unit = self._arrival.unit(linearisation.cost, self._redundancy + self._path.defect)
        if not trial.is_full or trial.length > unit:
            self._overshoot.forget()
            return trial
        share = self._overshoot.share_of(trial.move, linearisation.diagonal)
        return trial if share == 1.0 else scaled(trial, share)

    def _arrived(self, trial: Trial) -> StopReason | None:
        """Asks the full step, where the present one is so short that it may have arrived."""
        cost, weights = trial.linearisation.cost, trial.linearisation.diagonal
        redundancy = self._redundancy + self._path.defect
        if not trial.is_full:
            if trial.length > self._arrival.reach(cost, redundancy, weights):
                return None
            trial = self._path.full()
        return self._arrival.reason(trial.move, trial.length, cost, redundancy, weights)

    def _accepted(self, trial: Trial) -> tuple[Trial, StopReason | None]:
        """Tries shorter and shorter steps until one brings enough."""
        table = self._equations.table
        start = table.state()
        for _ in range(MOST_TRIALS):
            cost, after = trial.linearisation.cost, self._cost_after(trial.move)
            gain = gain_of(trial, cost, after)
            if gain <= LEAST_GAIN and np.isfinite(after) and self._restores(trial):
                self._restrained += 1
                return trial, None
            if gain <= LEAST_GAIN and self._is_dark(trial, cost, after):
                return trial, self._stumbled(trial)
            if self._refuses_first(trial, gain):
                table.restore(start)
            elif gain > LEAST_GAIN:
                self._learn(trial, gain, cost, after)
                self._restrained = 0 if trial.is_full else self._restrained + 1
                self._trail.follow(trial.move, trial.is_full)
                self._decrease = cost - after
                return trial, None
            else:
                table.restore(start)
                if self._is_rounding(trial):
                    return trial, StopReason.ROUNDING
                if self._takes_chance(trial, cost, after):
                    return trial, None
                self._learn(trial, gain, cost, after)
            trial = self._path.within(self._radius)
        return trial, StopReason.NO_DECREASE

    def _note_violation(self, weights: FloatArray) -> None:
        if not self._equations.constraints:
            return
        if self._violation is None:
            self._violation = Violation(self._equations, weights)
        self._violation.note()

    def _restores(self, trial: Trial) -> bool:
        """Whether a step that its cost refuses brings hard constraints nearer; the unknowns have moved."""
        if self._violation is None:
            return False
        return self._violation.narrows(resolution(self._equations.table, trial.linearisation.diagonal))

    def _cost_after(self, move: FloatArray) -> float:
        """Moves; the cost there, infinite where it is not defined."""
        table = self._equations.table
        start = table.state()
        table.move(move)
        try:
            return float(sum(self._equations.sums_of_squares().values()))
        except DivergenceError:
            return float("inf")
        except BaseException:
            table.restore(start)
            raise

    def _moved(self, move: FloatArray, cost: float) -> float:
        """Moves to where the cost is known."""
        self._equations.table.move(move)
        return cost

    def _is_dark(self, trial: Trial, cost: float, after: float) -> bool:
        """Whether the cost is too rounded to tell what the step brings; the unknowns have moved."""
        if not abs(after - cost) <= NEGLIGIBLE * cost:
            return False
        if trial.promised <= rounding_of_sum(self._equations) * cost:
            return True
        return trial.promised <= NEGLIGIBLE**3 * cost and trial.promised <= rounding_of_cost(self._equations)

    def _is_rounding(self, trial: Trial) -> bool:
        """Whether a full step that brings nothing is made of rounding: residuals that are all zero, say."""
        if not trial.is_full:
            return False
        cost, weights = trial.linearisation.cost, trial.linearisation.diagonal
        redundancy = self._redundancy + self._path.defect
        return self._arrival.is_rounding(trial.move, trial.length, cost, redundancy, weights)

    def _stumbled(self, trial: Trial) -> StopReason | None:
        """Counts the steps taken in the dark, which shrink as long as they lead somewhere."""
        shrinks = trial.length <= 0.5 * self._dark_length
        self._dark_length = min(trial.length, self._dark_length)
        self._in_the_dark = 0 if shrinks else self._in_the_dark + 1
        if self._in_the_dark < PATIENCE or self._tolerance < 0.0:
            return None
        cost = trial.linearisation.cost
        unit = self._arrival.unit(cost, self._redundancy + self._path.defect)
        self._linearise()
        close = self._path.full().length <= NEGLIGIBLE * unit
        return StopReason.ROUNDING if close else StopReason.NO_DECREASE

    def _refuses_first(self, trial: Trial, gain: float) -> bool:
        """The first step may be as long as it likes when it is as good as promised."""
        is_first, self._is_first = self._is_first, False
        if not is_first or gain >= GOOD or trial.norm <= self._path.first_radius:
            return False
        self._radius = min(self._path.first_radius, 0.5 * trial.norm)
        return True

    def _learn(self, trial: Trial, gain: float, cost: float, after: float) -> None:
        """The radius shrinks with poor gains, to the minimum of a parabola, and grows with good ones."""
        self._poor = self._poor + 1 if trial.is_full and gain <= POOR else 0
        if self._path.is_bold and trial.is_full and gain > LEAST_GAIN and self._poor < SWINGS:
            return
        if gain <= POOR:
            refused = gain <= LEAST_GAIN or np.isinf(self._radius)
            reach = trial.norm if refused else min(self._radius, 10.0 * trial.norm)
            self._radius = share_of(trial, cost, after) * reach
        elif self._path.is_bold and trial.is_full:
            self._radius = np.inf
        elif trial.is_full or gain >= GOOD:
            self._radius = 2.0 * min(max(gain, 1.0), FASTEST) * trial.norm
        elif np.isinf(self._radius):
            self._radius = trial.norm

    def _takes_chance(self, trial: Trial, cost: float, after: float) -> bool:
        """An excursion where a full step was refused, a few times; the unknowns are at their start.

        Bold ones make it near the minimum only, for half of what the step promises.
        """
        if not trial.is_full or self._chances == 0 or after > STEEPEST * cost:
            return False
        if self._path.is_bold and trial.promised > NEARBY * cost:
            return False
        self._chances -= 1
        return self._excursion(trial, after, cost - 0.5 * trial.promised if self._path.is_bold else 0.0)

    def _excursion(self, trial: Trial, known: float | None = None, enough: float = 0.0) -> bool:
        """A few full steps whatever the cost (Chamberlain's watchdog): along a bent valley they may lead on.

        The unknowns have moved to a cost well below, or are where they were, linearised anew.
        """
        enough = max(enough, WORTHWHILE * trial.linearisation.cost)
        if self._restrained:
            enough = max(enough, trial.linearisation.cost - AHEAD * self._decrease)
        self._restrained = 0
        start = self._equations.table.state()
        way = self._way_below(trial, enough, known)
        self._arrival.interrupt()
        if way is not None:
            self._radius, self._prompt = max(self._radius, way), FIRST_EXCURSION
            return True
        self._prompt *= 2
        self._equations.table.restore(start)
        self._linearise(in_passing=True)
        return False

    def _leap(self, cost: float) -> bool:
        """Leaps along the trail as far as it is long, then takes two steps back to the bottom of the valley.

        The unknowns have moved to a cost well below, or are where they were, linearised anew.
        """
        self._arrival.interrupt()
        table, way = self._equations.table, self._trail.taken()
        start, enough = table.state(), cost - AHEAD * self._decrease
        table.move(way)
        try:
            for _ in range(LANDING):
                self._path.linearise(in_passing=True)
                trial = self._path.within(self._radius)
                way = way + trial.move
                if self._cost_after(trial.move) < enough:
                    self._trail.lead_on(way)
                    self._restrained = 0
                    return True
                self.known += 1
        except (DivergenceError, SingularSystemError):
            pass
        table.restore(start)
        self._linearise(in_passing=True)
        return False

    def _way_below(self, trial: Trial, enough: float, known: float | None) -> float | None:
        """Takes full steps until the cost is below `enough`; length of the way, None if it leads nowhere."""
        cost, way = trial.linearisation.cost, 0.0
        for _ in range(EXCURSION):
            after = self._cost_after(trial.move) if known is None else self._moved(trial.move, known)
            way, known = way + trial.norm, None
            if after < enough:
                return way
            if not trial.is_full or after > STEEPEST * cost:
                return None
            try:
                self._linearise(in_passing=True)
                trial = self._path.full()
            except (DivergenceError, SingularSystemError):
                return None
        return None
