"""The equations: one class each, and the list of those that gencode writes."""

from obseq.packages import GENERATOR, require

require("obseq.formulas", "gencode", *GENERATOR)

from obseq.formulas import radiometry
from obseq.formulas.backward import BACKWARD
from obseq.formulas.base import Formula
from obseq.formulas.beside import BESIDE
from obseq.formulas.bundles import BUNDLES
from obseq.formulas.clinometers import ClinoBloc, ClinoInBlock, ClinoNeedle, ClinoRot
from obseq.formulas.colinearity import COLINEARITIES
from obseq.formulas.distortion import DISTORTIONS
from obseq.formulas.drone import DRONE
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
from obseq.formulas.space import Dist3D, Dist3DParam, TopoSubFrame
from obseq.formulas.special_topography import (
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
    TopoAngle,
    TopoDH,
    TopoDist,
    TopoDistHz,
    TopoDX,
    TopoDY,
    TopoDZ,
    TopoHz,
    TopoScaledFrame,
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

__all__ = ["REGISTRY", "Formula"]
