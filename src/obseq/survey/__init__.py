"""Survey networks: points, observations, stations, files and initial values."""

from obseq.survey.adjustment import Adjustment
from obseq.survey.cor_file import read_cor, write_cor
from obseq.survey.initial import InitialValues, initial_values
from obseq.survey.model import (
    FieldBook,
    Observations,
    ObservationType,
    Orientation,
    Points,
    Stations,
    automatic_fix,
    join,
    make_points,
    merge_points,
)
from obseq.survey.network import Network
from obseq.survey.obs_file import read_obs, write_obs
from obseq.survey.point_file import PointFileOptions, read_points

__all__ = [
    "Adjustment",
    "FieldBook",
    "InitialValues",
    "Network",
    "ObservationType",
    "Observations",
    "Orientation",
    "PointFileOptions",
    "Points",
    "Stations",
    "automatic_fix",
    "initial_values",
    "join",
    "make_points",
    "merge_points",
    "read_cor",
    "read_obs",
    "read_points",
    "write_cor",
    "write_obs",
]
