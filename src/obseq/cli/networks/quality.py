"""The options that say what is wanted of the quality of an adjustment."""

import argparse
from typing import TYPE_CHECKING

from obseq.cli.parsing import probability
from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.survey import Quality


FLAGS = ("reliability", "variance_components", "ellipsoids", "effects", "inner", "relative", "a_priori")
"""Options that are on or off, called as the fields of `Quality`."""


def add_quality_arguments(command: argparse.ArgumentParser) -> None:
    """Add what is wanted beside residuals and precisions."""
    quality = command.add_argument_group("quality")
    quality.add_argument(
        "--no-reliability",
        dest="reliability",
        action="store_false",
        help="without redundancy numbers, standardised residuals and detectable biases",
    )
    quality.add_argument(
        "--level", type=probability, metavar="P", help="level of the test of one observation (0.001)"
    )
    quality.add_argument(
        "--power", type=probability, metavar="P", help="power of that test for detectable biases (0.8)"
    )
    quality.add_argument(
        "--snooping",
        choices=("w", "tau"),
        help="leave out the observations of errors that are named, where nothing else explains them as well: "
        "w where the sigmas are trusted, tau where only their proportions are",
    )
    quality.add_argument(
        "--snooping-level",
        type=probability,
        metavar="P",
        help="probability of leaving out anything where nothing is wrong (0.05)",
    )
    quality.add_argument(
        "--variance-components",
        action="store_true",
        help="estimate the sigmas of each kind of observation, and adjust with them",
    )
    quality.add_argument(
        "--ellipses", type=probability, metavar="P", help="confidence of the ellipses (standard ones: 0.39)"
    )
    quality.add_argument(
        "--effects",
        action="store_true",
        help="which point the detectable bias of each observation moves most, and by how much",
    )
    quality.add_argument(
        "--inner-precisions",
        dest="inner",
        action="store_true",
        help="precisions as if no point were known and all carried the datum, after the adjustment with the "
        "known points",
    )
    quality.add_argument(
        "--ellipsoids", action="store_true", help="error ellipsoids too (standard ones: 20 %%)"
    )
    quality.add_argument(
        "--relative", action="store_true", help="precision of each pair of points that observations join"
    )
    quality.add_argument(
        "--a-priori",
        action="store_true",
        help="precisions from the given sigmas, not scaled by the estimated sigma0",
    )


def quality_of(arguments: argparse.Namespace) -> "Quality":
    """What the options ask for; the defaults of `Quality` for the rest."""
    from obseq.survey import Quality

    if arguments.snooping_level is not None and arguments.snooping is None:
        raise InputError("--snooping-level goes with --snooping")
    names = ("level", "power", "snooping", "snooping_level", "ellipses")
    given = {name: getattr(arguments, name) for name in names if getattr(arguments, name) is not None}
    flags = {
        name: getattr(arguments, name)
        for name in (
            "reliability",
            "variance_components",
            "ellipsoids",
            "effects",
            "inner",
            "relative",
            "a_priori",
        )
    }
    return Quality(**given, **flags)
