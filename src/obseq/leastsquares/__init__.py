"""Least squares: unknowns by name, equations in batches, sparse normal equations, precisions.

Every public name is here; each is loaded when it is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

from obseq.errors import (
    ContradictoryConstraintsError,
    DivergenceError,
    SingularMatrixError,
    SingularSystemError,
    SolverStateError,
    SolverUnavailableError,
    StepError,
)

if TYPE_CHECKING:
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
    from obseq.leastsquares.problem.objects import (
        Calibration,
        Direction,
        Point,
        Pose,
        Rotation,
        Scalar,
        UnknownObject,
        Vector,
    )
    from obseq.leastsquares.problem.priors import Prior
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
    from obseq.leastsquares.statistics.snooping import Rejection, Snooping, SnoopingEnd, Statistic, snoop
    from obseq.leastsquares.statistics.variance_components import (
        Method,
        VarianceComponents,
        group_components,
        variance_components,
    )
    from obseq.leastsquares.system import LeastSquares

_HOMES = {
    "Attenuated": "problem.losses",
    "Batch": "problem.batches",
    "Calibration": "problem.objects",
    "Cauchy": "problem.losses",
    "Component": "statistics.component_equations",
    "Controlled": "iterations.strategies",
    "Curved": "problem.manifolds",
    "Direction": "problem.objects",
    "Dogleg": "iterations.strategies",
    "ErrorEllipses": "statistics.ellipses",
    "ErrorEllipsoids": "statistics.ellipses",
    "GaussNewton": "iterations.strategies",
    "GemanMcClure": "problem.losses",
    "GlobalTest": "statistics.hypothesis_tests",
    "Huber": "problem.losses",
    "IGG3": "problem.losses",
    "Iteration": "solution.result",
    "L1": "problem.losses",
    "LeastSquares": "system",
    "LeastSquaresResult": "solution.result",
    "LeftOut": "statistics.reliability",
    "LevenbergMarquardt": "iterations.strategies",
    "Loss": "problem.losses",
    "Manifold": "problem.manifolds",
    "Method": "statistics.variance_components",
    "ObservationReliability": "statistics.reliability",
    "Point": "problem.objects",
    "Pose": "problem.objects",
    "Prior": "problem.priors",
    "Rejection": "statistics.snooping",
    "RelativePrecision": "statistics.ellipses",
    "Reliability": "statistics.reliability",
    "Rotation": "problem.objects",
    "SOLVER_NAMES": "solvers",
    "Scalar": "problem.objects",
    "Snooping": "statistics.snooping",
    "SnoopingEnd": "statistics.snooping",
    "Solver": "solvers",
    "SolverStatistics": "solvers",
    "Statistic": "statistics.snooping",
    "StopReason": "solution.result",
    "Strategy": "iterations.strategies",
    "SymmetricPattern": "solvers",
    "Tukey": "problem.losses",
    "UnknownObject": "problem.objects",
    "VarianceComponents": "statistics.variance_components",
    "Vector": "problem.objects",
    "choose_solver": "solvers",
    "condition_number": "statistics.conditioning",
    "confidence_factor": "statistics.ellipses",
    "error_ellipses": "statistics.ellipses",
    "error_ellipsoids": "statistics.ellipses",
    "global_test": "statistics.hypothesis_tests",
    "graduated": "iterations.graduated",
    "group_components": "statistics.variance_components",
    "relative_precision": "statistics.ellipses",
    "reliability": "statistics.reliability",
    "snoop": "statistics.snooping",
    "variance_components": "statistics.variance_components",
}

__all__ = [
    "IGG3",
    "L1",
    "SOLVER_NAMES",
    "Attenuated",
    "Batch",
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
    "Pose",
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
    "variance_components",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'obseq.leastsquares' has no attribute {name!r}")
    return getattr(importlib.import_module(f"obseq.leastsquares.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
