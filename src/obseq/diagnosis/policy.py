"""The numbers by which errors are judged, all of them, each with its reason."""

from __future__ import annotations

import math

from obseq.dataclass import dataclass
from obseq.leastsquares.problem.losses import GemanMcClure, Huber


@dataclass(frozen=True)
class Policy:
    """How errors are judged.

    Attributes:
        false_alarm: Probability of any accusation where nothing is wrong, all tests together. Chosen.
        variance: Variance factor of the given sigmas: 1 where they are trusted.
        power: B-method: tests of any number of equations find the same error with it (Baarda's 80 %).
        odds: Likelihood ratio from which one explanation is told from another: 5, 20, 100 gave the same.
        unseen: Share of its own weight below which a column shows nothing: its inverse magnifies rounding.
        least: Sigmas by which what several observations share must change one of them, and be proved to, to
            be an error: what is less is within what sigmas announce. By the meaning of a sigma.
        suspect: Sigmas, at the robust place, from which backward elimination starts: beyond any noise. Of a
            misfit, usual sigmas from which it is large whatever its own sigma says.
        whole: Share of the rows of a block that must be off: two errors in one set-up are no wrong set-up.
        share: Share of all squares that an effect which is not linear must explain to be tried as what it is.
        half: Share of the redundancy that what is accused may take, of a kind that is off, of sigmas that are
            out of line: of more, the rest would be the error.
        better: Share of its contradictions that a mistake of many values leaves a network at most.
        nameless: Contradictions by which such a mistake must be better where no slip explains it.
        equal: Contradictions by which two of them may differ that explain a network equally well.
        part: Observations of a part of a network on which mistakes of many values are tried: some hundred
            points show what all share, and a trial costs what it does in a small network.
        few: Errors that are told before it is asked whether many values share a mistake.
        most: Errors that are told one by one.
        begun: Suspects from which backward elimination starts, the worst of them.
        held_down: Errors that are told where robust weights hold them down: so many cost ten adjustments.
            And columns of a large model, and sets of columns, that are solved for at one place, the worst
            of those that pass the screen: more pass only where nearly everything contradicts, or of 400,000.
        exchanges: Exchanges of one hypothesis for another at most: masked pairs take one or two.
        rounds: Linearisations at most, for one explanation.
        trials: Changes, or starts without one row, that are adjusted anew.
        near: Standard deviations within which a slip fits.
        chance: Probability of a fit by any error, above which a slip with a free choice is not told.
        likely: The same, below which a slip is believed, and tells where the error is.
        noted: Half of the millimetre to which heights and constants are noted (m).
        large: Equations from which groups are tested only where a screen asks for it.
        screen: |w| of a group, its equations taken apart, from which it is tested there. Without error one in
            four hundred passes; an error at the limit of its test (near 5) is lost only where the group shows
            less than a third of what its equations show one by one.
        sigmas: Rarity of sigmas that are all too small by one factor: as of groups.
        out_of_line: Times by which a sigma is larger or smaller than the usual one of its kind, from which it
            is told if it hides an error or makes one: no instrument is so much better than its like. Chosen.
        columns: Equations of a group that takes them out one by one, up to which it is tested: each is solved
            for, and all their products are kept.
        steps, steps_of_large: Iterations of all adjustments together; of models with more equations than
            `large`, where their time is that of a few adjustments.
    """

    false_alarm: float = 0.005
    variance: float = 1.0
    power: float = 0.80
    odds: float = 20.0
    unseen: float = 1e-4
    least: float = 1.0
    suspect: float = 6.0
    whole: float = 0.6
    share: float = 0.1
    half: float = 0.5
    better: float = 0.5
    nameless: float = 0.5
    equal: float = 0.1
    part: int = 1000
    few: int = 3
    most: int = 12
    begun: int = 60
    held_down: int = 200
    exchanges: int = 4
    rounds: int = 4
    trials: int = 4
    near: float = 3.0
    chance: float = 0.35
    likely: float = 0.02
    noted: float = 0.0005
    large: int = 5000
    screen: float = 3.0
    sigmas: float = 4.0
    out_of_line: float = 100.0
    columns: int = 1000
    steps: int = 240
    steps_of_large: int = 60

    @property
    def margin(self) -> float:
        """Squares by which the price of one explanation must be lower to be told from another."""
        return 2.0 * math.log(self.odds)


POLICY = Policy()
LOSSES: tuple[Huber | GemanMcClure, ...] = (Huber(1.5), GemanMcClure(8.0), GemanMcClure(4.0))
"""Of the robust start, one after the other: the first has one minimum, the others forget what is far off."""
NO_WEIGHT = 1e6
"""Times its sigma, an observation has no influence; what it alone determines stays where it is."""
