"""The equations: one class each, the list of those that gencode writes, and members of families by name."""

from obseq.errors import FormulaError, nearest
from obseq.packages import GENERATOR, require

require("obseq.formulas", "gencode", *GENERATOR)

from obseq.formulas import radiometry
from obseq.formulas.backward import BACKWARD
from obseq.formulas.base import Formula
from obseq.formulas.bundles import BUNDLES
from obseq.formulas.clinometers import ClinoBloc, ClinoInBlock, ClinoNeedle, ClinoRot
from obseq.formulas.colinearity import COLINEARITIES, DRONE
from obseq.formulas.distortion import DISTORTIONS
from obseq.formulas.image_deformation import (
    DeformImAffinity,
    DeformImHomography,
    DeformImHomotethy,
    LGrad_DeformImHomotethy,
)
from obseq.formulas.lidar import (
    EqLidarImCensus,
    EqLidarImCensusPose,
    EqLidarImCorrel,
    EqLidarImCorrelPose,
    EqLidarImPonct,
    EqLidarImPonctPose,
    EqLidarLidar,
)
from obseq.formulas.plane import (
    Dist2DCons,
    PropCovNwCD,
    RatioDist2DCons,
    SetPointNwCDFixed,
    SetPointNwCDUnknown,
    SumSquare,
)
from obseq.formulas.projections import CENTRAL_PROJECTIONS
from obseq.formulas.rigid_blocks import BlocRigid, BlocRigid_RE, KnownRotation, RigidPair, VNormOrthog
from obseq.formulas.sensors import SENSORS
from obseq.formulas.special_topography import (
    BESIDE,
    AxisLink,
    AxisPlane,
    AxisRadius,
    TopoAlpha,
    TopoBeta,
    TopoDHParam,
    TopoDHParamOff,
    TopoDistHz0,
)
from obseq.formulas.topography import (
    Dist3D,
    Dist3DParam,
    TopoAngle,
    TopoDH,
    TopoDist,
    TopoDistHz,
    TopoDX,
    TopoDY,
    TopoDZ,
    TopoHz,
    TopoScaledFrame,
    TopoSubFrame,
    TopoZen,
)

REGISTRY: tuple[Formula, ...] = (
    Dist3D(),
    Dist3DParam(),
    TopoSubFrame(),
    TopoHz(),
    TopoZen(),
    TopoDist(),
    TopoDX(),
    TopoDY(),
    TopoDZ(),
    TopoDH(),
    TopoScaledFrame(),
    TopoDistHz(),
    TopoAngle(),
    TopoDistHz0(),
    TopoAlpha(),
    TopoBeta(),
    TopoDHParam(),
    TopoDHParamOff(),
    *BESIDE,
    AxisRadius(),
    AxisPlane(),
    AxisLink(),
    SumSquare(8),
    Dist2DCons(),
    RatioDist2DCons(),
    PropCovNwCD(4),
    SetPointNwCDUnknown(4),
    SetPointNwCDFixed(4),
    SetPointNwCDUnknown(3),
    BlocRigid(),
    BlocRigid_RE(),
    RigidPair(),
    KnownRotation(),
    VNormOrthog(),
    ClinoInBlock(0, 3),
    ClinoBloc(),
    ClinoNeedle(),
    ClinoRot(),
    EqLidarImPonct(),
    EqLidarImPonctPose(),
    EqLidarImCensus(),
    EqLidarImCensusPose(),
    EqLidarImCorrel(),
    EqLidarImCorrelPose(),
    EqLidarLidar(),
    DeformImHomotethy(),
    LGrad_DeformImHomotethy(),
    DeformImAffinity(),
    DeformImHomography(),
    *radiometry.REGISTERED,
    *DISTORTIONS,
    *CENTRAL_PROJECTIONS,
    *COLINEARITIES,
    *BACKWARD,
    *DRONE,
    *SENSORS,
    *BUNDLES,
)

FAMILIES: tuple[type[Formula], ...] = tuple(
    dict.fromkeys(type(registered) for registered in REGISTRY if "{" in registered.pattern)
)
"""The classes of the registry whose names have fields."""


def find(name: str) -> Formula | None:
    """The formula of the registry, else the member of a family, of a name; None when there is none.

    Raises:
        FormulaError: A number in the name is too large or too small for its family.
    """
    for registered in REGISTRY:
        if registered.name == name:
            return registered
    members = (member for family in FAMILIES if (member := family.from_name(name)) is not None)
    return next(members, None)


def formula(name: str) -> Formula:
    """The formula of a name: of the registry, else the member of a family.

    Raises:
        FormulaError: No formula has that name; the message gives the nearest ones.
    """
    if (found := find(name)) is not None:
        return found
    near = nearest(name, [registered.name for registered in REGISTRY])
    raise FormulaError(f"no formula is named {near} (gencode --list gives all)")


__all__ = ["FAMILIES", "REGISTRY", "Formula", "find", "formula"]
