"""Survey networks: points, observations, stations and initial values.

Names are loaded when they are first used: who adjusts a network does not load what plans one.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from obseq.formats.obs.cor import read_cor, write_cor
    from obseq.formats.obs.free_points import read_points
    from obseq.formats.obs.obs import read_obs, write_obs
    from obseq.formats.tables.network import network_from_tables
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.datum import Datum
    from obseq.survey.adjustment.instrument_unknowns import estimating
    from obseq.survey.adjustment.quality import Quality
    from obseq.survey.epochs.comparison import Comparison, compare
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
    from obseq.survey.point_file_options import PointFileOptions

_HOMES = {
    "Adjustment": "adjustment.adjusted",
    "Comparison": "epochs.comparison",
    "Datum": "adjustment.datum",
    "FieldBook": "model",
    "InitialValues": "initial.initial_values",
    "KINDS": "kinds.registry",
    "Network": "network",
    "ObservationKind": "kinds.kind",
    "Observations": "model",
    "Orientation": "model",
    "Plan": "planning.design",
    "PointFileOptions": "point_file_options",
    "Points": "model",
    "Quality": "adjustment.quality",
    "Stations": "model",
    "automatic_fix": "model",
    "compare": "epochs.comparison",
    "estimating": "adjustment.instrument_unknowns",
    "initial_values": "initial.initial_values",
    "join": "model",
    "kind_of_formula": "kinds.registry",
    "make_points": "model",
    "merge_points": "model",
    "network_from_tables": ".formats.tables.network",
    "plan": "planning.design",
    "read_cor": ".formats.obs.cor",
    "read_obs": ".formats.obs.obs",
    "read_points": ".formats.obs.free_points",
    "simulate": "planning.simulation",
    "write_cor": ".formats.obs.cor",
    "write_obs": ".formats.obs.obs",
}

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


def __getattr__(name: str) -> object:
    if name in _HOMES:
        return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    return importlib.import_module("obseq.survey.former").find(name)


def __dir__() -> list[str]:
    return sorted(__all__)
