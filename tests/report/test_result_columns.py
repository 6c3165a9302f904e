"""A result as columns: equal to that of JSON, refused where it is damaged, written in little memory."""

import json
import tracemalloc
import zipfile
from io import BytesIO

import numpy as np
import pytest
from msgspec.structs import replace

import obseq
from obseq.errors import InputError
from obseq.records.adjustment import EffectRecord, EllipseRecord, EllipsoidRecord, ObservationRecord
from obseq.records.columns import Lazy, Texts
from obseq.records.rows import Rows
from obseq.report.result_columns import write_columns
from obseq.report.result_file import read_json, to_json
from obseq.writing import write_all


@pytest.fixture
def full(record):
    """Every field that a point or an observation may have."""
    ellipsoid = EllipsoidRecord((3.0, 2.0, 1.0), (0.1, 0.2, 0.3), (0.0, 0.5, 1.0))
    more = {
        "ellipse": EllipseRecord(2.0, 1.0, 0.5),
        "ellipsoid": ellipsoid,
        "covariance": (1.0, None, 0.0, 2.0, 0.0, 3.0),
        "known": "xY",
        "moved": (0.1, None, -0.0),
        "inner": (1.0, 2.0, 3.0),
    }
    points = [replace(record.points[0], **more), *record.points[1:]]
    effect = EffectRecord("B", 1.0, 2.0, 3.0)
    rows = [
        replace(record.observations[0], effect=effect, backsight="C", rejected=True),
        *record.observations[1:],
    ]
    return replace(record, points=points, observations=rows, title="\u00e9 \udcff")


@pytest.fixture
def saved(full, tmp_path):
    path = tmp_path / "a.npz"
    write_all({path: lambda file: write_columns(file, full)})
    return path


def test_columns_and_json_are_the_same_record(full, saved, tmp_path) -> None:
    (tmp_path / "a.json").write_text(to_json(full), encoding="utf-8")
    found = obseq.load(saved)
    assert found == full == read_json(tmp_path / "a.json")
    assert to_json(found) == to_json(full)


def test_numpy_opens_the_columns(full, saved) -> None:
    with np.load(saved) as arrays:
        assert arrays["points.x"].tolist() == [point.x for point in full.points]
        said = json.loads(arrays["record.json"])["observations"]
        texts = json.loads(arrays[said["texts"]["from"]])
        assert [texts[k] for k in arrays["observations.from"]] == [row.origin for row in full.observations]


def test_equal_results_are_equal_files(full, saved) -> None:
    again = BytesIO()
    write_columns(again, obseq.load(saved))
    assert again.getvalue() == saved.read_bytes()


def rewritten(path, change) -> None:
    """The archive with other members."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def with_layout(members) -> None:
    members["record.json"] = members["record.json"].replace(b'"layout": 1', b'"layout": 2')


def with_version(members) -> None:
    members["record.json"] = members["record.json"].replace(b'"version": 1', b'"version": 2')


def without(name):
    return lambda members: members.pop(name)


def said_without(members) -> None:
    members["record.json"] = members["record.json"].replace(b'"name", ', b"", 1).replace(b'"name",', b"", 1)


def with_array(name, values):
    def change(members) -> None:
        file = BytesIO()
        np.lib.format.write_array(file, values)
        members[name] = file.getvalue()

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_layout, "its layout is 2, and this version of obseq reads 1"),
        (with_version, "another version"),
        (without("points.x.npy"), "points.x.npy is missing"),
        (without("record.json"), "record.json is missing"),
        (said_without, "the column name of PointRecord is missing"),
        (with_array("points.x.npy", np.zeros(2)), "points.x.npy has 2 rows, not 3"),
        (with_array("points.name.npy", np.array([0, 1, 3], np.int32)), "leads to texts that are not in"),
        (with_array("points.name.npy", np.array([0, 1, -2], np.int32)), "leads to texts that are not in"),
        (lambda members: members.update({"points.x.npy": b"x"}), "points.x.npy: "),
    ],
)
def test_what_is_damaged_is_refused_in_words(change, message, saved) -> None:
    rewritten(saved, change)
    with pytest.raises(InputError, match=message) as found:
        list(obseq.load(saved).points)
    assert str(saved) in str(found.value)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_what_is_cut_off_is_refused(share, saved) -> None:
    saved.write_bytes(saved.read_bytes()[: int(share * saved.stat().st_size)])
    with pytest.raises(InputError, match="damaged"):
        obseq.load(saved)


def test_a_bit_that_fell_over_is_found(saved) -> None:
    content = bytearray(saved.read_bytes())
    place = content.index(b"points.sx.npy") + len("points.sx.npy") + 30
    content[place] ^= 1
    saved.write_bytes(content)
    with pytest.raises(InputError, match=r"points\.sx\.npy"):
        list(obseq.load(saved).points)


def test_a_failure_leaves_what_was_there(full, saved) -> None:
    before = saved.read_bytes()

    def broken(name: str):
        raise ZeroDivisionError(name)

    worse = replace(full, points=Rows.of(type(full.points[0]), Lazy(["name"], broken), 3))
    with pytest.raises(ZeroDivisionError):
        write_all({saved: lambda file: write_columns(file, worse)})
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_memory_is_that_of_a_few_columns(full, saved) -> None:
    n = 200_000

    def column(name: str):
        if name in ("type", "from", "to", "file"):
            return Texts(np.zeros(n, np.int32), ["a"])
        return np.full(n, 1.5) if name not in ("line", "active") else np.ones(n, np.int64)

    names = [
        "type",
        "from",
        "to",
        "value",
        "sigma",
        "residual",
        "normalised_residual",
        "file",
        "line",
        "active",
    ]
    rows = Rows.of(ObservationRecord, Lazy([*names, "tau", "detectable", "external", "blunder"], column), n)
    tracemalloc.start()
    try:
        write_all({saved: lambda file: write_columns(file, replace(full, observations=rows))})
        found = obseq.load(saved).observations
        assert found.numbers("tau").sum() == 1.5 * n
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 4 * 8 * n
    assert found[n - 1] == rows[n - 1]
