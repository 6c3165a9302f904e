"""A wrong kind of argument of a public function of survey, crs, report or calculator gets our errors only."""

import dataclasses
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import obseq
from obseq import crs, survey
from obseq.errors import ObseqError
from obseq.records.adjustment import AdjustmentRecord
from obseq.report.adjusted import outcome
from obseq.report.page import page
from obseq.report.result_file import read_json, to_json

FRAME, LAMBERT = "RTL*657700*6860700*0*IGNF:LAMB93", "IGNF:LAMB93"
WRONG = {
    "None": None,
    "whole": 3,
    "number": 2.5,
    "negative": -1,
    "nan": float("nan"),
    "huge": 10**400,
    "complex": 1j,
    "truth": True,
    "text": "x",
    "bytes": b"x",
    "zero byte": "a\0b",
    "list": [],
    "mixed": ["x", None],
    "ragged": [[1, 2], [3]],
    "dict": {},
    "set": {1},
    "array": np.zeros((2, 2, 2)),
    "object": object(),
}
PLACES = np.array([[657700.0, 6860700.0, 10.0], [657710.0, 6860710.0, 11.0]])
LOCAL = np.array([[1.0, 2.0, 3.0], [40.0, 50.0, 6.0]])


@dataclasses.dataclass
class Site:
    """A folder with the demo, and everything that can be made of it."""

    network: survey.Network
    adjusted: survey.Adjustment
    record: AdjustmentRecord
    points: survey.Points
    book: survey.FieldBook


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Site:
    folder = tmp_path_factory.mktemp("site")
    for name in ("demo.obs", "demo.cor"):
        (folder / name).write_bytes((files("obseq.survey") / "data" / name).read_bytes())
    network = survey.Network.read(folder / "demo.obs", folder / "demo.cor", frame=FRAME, points_crs=LAMBERT)
    adjusted = network.adjust()
    record = adjusted.record()
    (folder / "a.json").write_text(to_json(record), encoding="utf-8")
    points, book = survey.join(survey.read_cor(folder / "demo.cor"), survey.read_obs(folder / "demo.obs"))
    return Site(network, adjusted, record, points, book)


@pytest.fixture(autouse=True)
def _in_the_folder(site: Site, monkeypatch) -> None:
    monkeypatch.chdir(Path(site.book.files[0]).parent)


def calculator_of(site: Site) -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    distance = obseq.calculator("Dist3D")
    u, o = np.ones((2, len(distance.unknowns))), np.ones((2, len(distance.observations)))
    return [
        (obseq.calculator, {"name": "Dist3D"}),
        (distance.values, {"unknowns": u, "observations": o}),
        (distance.values_and_jacobian, {"unknowns": u, "observations": o}),
        (distance.check_finite, {"values": u}),
    ]


def crs_of(site: Site) -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    lambert, frame = crs.parse(LAMBERT), crs.parse(FRAME)
    transformer = crs.Transformer(lambert, frame)
    return [
        (crs.parse, {"definition": LAMBERT, "aliases": {}}),
        (crs.Transformer, {"source": lambert, "target": frame}),
        (transformer.forward, {"points": PLACES, "names": ["A", "B"]}),
        (transformer.inverse, {"points": LOCAL, "names": ["A", "B"]}),
        (crs.complete_rtl, {"points": PLACES, "source": lambert}),
        (crs.rtl_at, {"origin": PLACES[0], "source": lambert}),
        (
            crs.refraction_correction,
            {"system": frame, "origins": LOCAL, "targets": LOCAL + 9.0, "coefficient": 0.1},
        ),
        (crs.horizontal_distance, {"system": frame, "origins": LOCAL, "targets": LOCAL + 9.0}),
        (crs.curvature_radius, {"latitude": 0.8}),
        (crs.east_north_up, {"longitude": 0.1, "latitude": 0.8}),
        (lambert.to_geocentric, {"points": PLACES}),
        (lambert.geodetic, {"points": PLACES}),
        (frame.vertical_rotation, {"points": LOCAL}),
    ]


def survey_of(site: Site) -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    options = survey.PointFileOptions(comment="*")
    given = {
        "observation_files": "demo.obs",
        "point_files": "demo.cor",
        "frame": FRAME,
        "points_crs": LAMBERT,
        "point_sigma": None,
        "encoding": "utf-8",
        "point_format": None,
        "point_options": None,
        "ignore": (),
        "refraction": 0.12,
        "geoid": None,
    }
    planned = {"network": site.network, "with_gains": False, "farthest": None, "counted": None, "seed": 0}

    def read_with(**changes: Any) -> survey.Points:
        return survey.read_points("demo.cor", "ANXYZBla", dataclasses.replace(options, **changes))

    return [
        (survey.Network.read, given),
        (site.network.adjust, {"max_iterations": 20, "tolerance": 1e-6, "strict": False, "progress": None}),
        (survey.read_obs, {"paths": "demo.obs", "encoding": "utf-8", "ignore": ()}),
        (survey.read_cor, {"paths": "demo.cor", "default_sigma": 0.1, "encoding": "utf-8"}),
        (survey.read_points, {"path": "demo.cor", "field_format": "ANXYZBla", "options": options}),
        (read_with, dataclasses.asdict(options)),
        (survey.write_obs, {"path": "o.obs", "book": site.book}),
        (survey.write_cor, {"path": "o.cor", "points": site.points, "header": ""}),
        (survey.make_points, {"names": ["A", "B"], "coordinates": PLACES, "sigmas": LOCAL}),
        (survey.merge_points, {"parts": [site.points]}),
        (survey.join, {"points": site.points, "book": site.book}),
        (survey.compare, {"first": site.adjusted, "second": site.adjusted}),
        (survey.plan, planned),
        (survey.simulate, {"network": site.network, "seed": 1, "noise": True}),
        (survey.automatic_fix, {"book": site.book}),
        (
            survey.initial_values,
            {"points": site.points, "book": site.book, "vertical": None, "recompute_free": False},
        ),
    ]


def report_of(site: Site) -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    return [
        (outcome, {"record": site.record}),
        (page, {"record": site.record}),
        (to_json, {"record": site.record}),
        (read_json, {"path": "a.json"}),
        (AdjustmentRecord.from_dict, {"plain": site.record.to_dict()}),
    ]


@pytest.mark.parametrize("room", [calculator_of, crs_of, survey_of, report_of])
def test_a_wrong_kind_of_argument_gets_our_error(room, site: Site) -> None:
    refused = 0
    for function, good in room(site):
        for argument in good:
            for kind, value in WRONG.items():
                try:
                    function(**good | {argument: value})
                except ObseqError:
                    refused += 1
                except Exception as error:
                    pytest.fail(
                        f"{function.__qualname__}({argument}={kind}): {type(error).__name__}: {error}"
                    )
    assert refused > 50


def test_the_message_names_function_argument_and_what_was_given() -> None:
    with pytest.raises(obseq.InputError, match=r"read_obs: encoding must be a text, not 3 \(int\)"):
        survey.read_obs("a.obs", encoding=3)
    with pytest.raises(
        obseq.InputError, match=r"Network.read: frame must be a text or None, not b'RTL' \(bytes\)"
    ):
        survey.Network.read("a.obs", "a.cor", b"RTL")
