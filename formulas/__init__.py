"""The equations: one class each, and the list of those that gencode writes."""

from obseq.formulas.base import Formula
from obseq.formulas.space import Dist3D, Dist3DParam, TopoSubFrame
from obseq.formulas.topography import TopoDH, TopoDist, TopoDX, TopoDY, TopoDZ, TopoHz, TopoZen

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
)

__all__ = ["REGISTRY", "Formula"]
