"""Least squares: unknowns by name, equations in batches, sparse normal equations, precisions.

Every public name is here; each is loaded when it is first used.
"""

from typing import TYPE_CHECKING

from obseq.errors import (
    ContradictoryConstraintsError,
    DivergenceError,
    SingularMatrixError,
    SingularSystemError,
    SolverStateError,
    SolverUnavailableError,
    StepError,
)
from obseq.lazy import lazy_names

if TYPE_CHECKING:
    from obseq.leastsquares.helmert.adjustment import BlockSolution, solve_in_blocks
    from obseq.leastsquares.iterations.graduated import graduated
    from obseq.leastsquares.iterations.strategies import (
        Controlled,
        Dogleg,
        GaussNewton,
        LevenbergMarquardt,
        Strategy,
    )
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.losses import (
        IGG3,
        L1,
        Attenuated,
        Cauchy,
        GemanMcClure,
        Huber,
        Loss,
        Tukey,
    )
    from obseq.leastsquares.problem.manifolds import Curved, Manifold
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.problem.unknown_objects import (
        Calibration,
        Direction,
        Point,
        Rotation,
        Scalar,
        UnknownObject,
        UnknownPose,
        Vector,
    )
    from obseq.leastsquares.solution.result import Iteration, LeastSquaresResult, StopReason
    from obseq.leastsquares.solvers import (
        SOLVER_NAMES,
        Solver,
        SolverStatistics,
        SymmetricPattern,
        choose_solver,
    )
    from obseq.leastsquares.statistics.component_equations import Component
    from obseq.leastsquares.statistics.conditioning import condition_number
    from obseq.leastsquares.statistics.ellipses import (
        ErrorEllipses,
        ErrorEllipsoids,
        RelativePrecision,
        confidence_factor,
        error_ellipses,
        error_ellipsoids,
        relative_precision,
    )
    from obseq.leastsquares.statistics.hypothesis_tests import GlobalTest, global_test
    from obseq.leastsquares.statistics.reliability import (
        LeftOut,
        ObservationReliability,
        Reliability,
        reliability,
    )
    from obseq.leastsquares.statistics.snooping import Rejection, Snooping, SnoopingEnd, snoop
    from obseq.leastsquares.statistics.snooping_tests import Statistic
    from obseq.leastsquares.statistics.variance_components import (
        Method,
        VarianceComponents,
        group_components,
        variance_components,
    )
    from obseq.leastsquares.system import LeastSquares

_HOMES = {
    "helmert.adjustment": ("BlockSolution", "solve_in_blocks"),
    "iterations.graduated": ("graduated",),
    "iterations.strategies": ("Controlled", "Dogleg", "GaussNewton", "LevenbergMarquardt", "Strategy"),
    "problem.batches": ("Batch",),
    "problem.losses": ("Attenuated", "Cauchy", "GemanMcClure", "Huber", "IGG3", "L1", "Loss", "Tukey"),
    "problem.manifolds": ("Curved", "Manifold"),
    "problem.unknown_objects": (
        "Calibration",
        "Direction",
        "Point",
        "UnknownPose",
        "Rotation",
        "Scalar",
        "UnknownObject",
        "Vector",
    ),
    "problem.priors": ("Prior",),
    "solution.result": ("Iteration", "LeastSquaresResult", "StopReason"),
    "solvers": ("SOLVER_NAMES", "Solver", "SolverStatistics", "SymmetricPattern", "choose_solver"),
    "statistics.component_equations": ("Component",),
    "statistics.conditioning": ("condition_number",),
    "statistics.ellipses": (
        "ErrorEllipses",
        "ErrorEllipsoids",
        "RelativePrecision",
        "confidence_factor",
        "error_ellipses",
        "error_ellipsoids",
        "relative_precision",
    ),
    "statistics.hypothesis_tests": ("GlobalTest", "global_test"),
    "statistics.reliability": ("LeftOut", "ObservationReliability", "Reliability", "reliability"),
    "statistics.snooping": ("Rejection", "Snooping", "SnoopingEnd", "snoop"),
    "statistics.snooping_tests": ("Statistic",),
    "statistics.variance_components": (
        "Method",
        "VarianceComponents",
        "group_components",
        "variance_components",
    ),
    "system": ("LeastSquares",),
}

__all__ = [
    "IGG3",
    "L1",
    "SOLVER_NAMES",
    "Attenuated",
    "Batch",
    "BlockSolution",
    "Calibration",
    "Cauchy",
    "Component",
    "ContradictoryConstraintsError",
    "Controlled",
    "Curved",
    "Direction",
    "DivergenceError",
    "Dogleg",
    "ErrorEllipses",
    "ErrorEllipsoids",
    "GaussNewton",
    "GemanMcClure",
    "GlobalTest",
    "Huber",
    "Iteration",
    "LeastSquares",
    "LeastSquaresResult",
    "LeftOut",
    "LevenbergMarquardt",
    "Loss",
    "Manifold",
    "Method",
    "ObservationReliability",
    "Point",
    "Prior",
    "Rejection",
    "RelativePrecision",
    "Reliability",
    "Rotation",
    "Scalar",
    "SingularMatrixError",
    "SingularSystemError",
    "Snooping",
    "SnoopingEnd",
    "Solver",
    "SolverStateError",
    "SolverStatistics",
    "SolverUnavailableError",
    "Statistic",
    "StepError",
    "StopReason",
    "Strategy",
    "SymmetricPattern",
    "Tukey",
    "UnknownObject",
    "UnknownPose",
    "VarianceComponents",
    "Vector",
    "choose_solver",
    "condition_number",
    "confidence_factor",
    "error_ellipses",
    "error_ellipsoids",
    "global_test",
    "graduated",
    "group_components",
    "relative_precision",
    "reliability",
    "snoop",
    "solve_in_blocks",
    "variance_components",
]

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__, {"Pose": "UnknownPose"})
