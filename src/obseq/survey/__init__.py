"""Survey networks: points, observations, stations, files and initial values."""

from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.datum import Datum
from obseq.survey.adjustment.instruments import estimating
from obseq.survey.adjustment.quality import Quality
from obseq.survey.epochs.comparison import Comparison, compare
from obseq.survey.files.cor import read_cor, write_cor
from obseq.survey.files.obs import read_obs, write_obs
from obseq.survey.files.point import PointFileOptions, read_points
from obseq.survey.former import find
from obseq.survey.in_memory import network_from_tables
from obseq.survey.initial.initial_values import InitialValues, initial_values
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.registry import KINDS, kind_of_formula
from obseq.survey.model import (
    FieldBook,
    Observations,
    Orientation,
    Points,
    Stations,
    automatic_fix,
    join,
    make_points,
    merge_points,
)
from obseq.survey.network import Network
from obseq.survey.planning.design import Plan, plan
from obseq.survey.planning.simulation import simulate

__getattr__ = find

__all__ = [
    "KINDS",
    "Adjustment",
    "Comparison",
    "Datum",
    "FieldBook",
    "InitialValues",
    "Network",
    "ObservationKind",
    "Observations",
    "Orientation",
    "Plan",
    "PointFileOptions",
    "Points",
    "Quality",
    "Stations",
    "automatic_fix",
    "compare",
    "estimating",
    "initial_values",
    "join",
    "kind_of_formula",
    "make_points",
    "merge_points",
    "network_from_tables",
    "plan",
    "read_cor",
    "read_obs",
    "read_points",
    "simulate",
    "write_cor",
    "write_obs",
]
