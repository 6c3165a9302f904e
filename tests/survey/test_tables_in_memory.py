"""Networks from tables in memory, and results as tables."""

from importlib.resources import files

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network, network_from_tables
from obseq.survey.model import Orientation

POINTS = {
    "name": ["PtA", "PtB", "PtC", "PtD"],
    "x": [657700.0, 657710.0, 657710.0, 657700.0],
    "y": [6860700.0, 6860700.0, 6860710.0, 6860690.0],
    "z": [10.0, 10.0, 10.0, 10.0],
    "sx": [0.001, None, None, 0.001],
    "sy": [0.001, None, None, 0.001],
    "sz": [0.001, None, None, 0.001],
}
SIGHTS = [("PtA", "PtB"), ("PtA", "PtC"), ("PtD", "PtB"), ("PtD", "PtC")]
READINGS = [(0.0, 100.0, 10.05), (-40.62, 100.0, 14.88), (0.0, 100.0, 14.88), (-14.96, 100.0, 22.82)]


def observations() -> dict[str, list]:
    rows = [
        (kind, *ends, value, 0.005 if kind == "Dist" else 0.001)
        for ends, values in zip(SIGHTS, READINGS, strict=True)
        for kind, value in zip(("Hz", "Zen", "Dist"), values, strict=True)
    ]
    return dict(
        zip(("type", "from", "to", "value", "sigma"), map(list, zip(*rows, strict=True)), strict=True)
    )


def made(**changes) -> Network:
    table = observations() | changes.pop("observations", {})
    return network_from_tables(POINTS | changes, table, points_crs="IGNF:LAMB93", angles="gon")


@pytest.fixture(scope="module")
def adjusted():
    return made().adjust()


def test_a_network_in_memory_is_that_of_its_files(adjusted) -> None:
    data = files("obseq.survey") / "data"
    read = Network.read(str(data / "demo.obs"), str(data / "demo.cor"), points_crs="IGNF:LAMB93").adjust()
    assert adjusted.sigma0 == pytest.approx(read.sigma0, rel=1e-9)
    order = [read.points.names.index(name) for name in adjusted.points.names]
    np.testing.assert_allclose(adjusted.points.coordinates, read.points.coordinates[order], atol=1e-9)


def test_results_come_back_as_columns(adjusted) -> None:
    points, rows = adjusted.table("points"), adjusted.table("observations")
    np.testing.assert_array_equal(points["x"], adjusted.points.coordinates[:, 0])
    assert rows["from"] == observations()["from"]
    np.testing.assert_allclose(rows["residual"], adjusted.residuals)
    with pytest.raises(InputError, match="no table 'sigma0'"):
        adjusted.table("sigma0")


def test_data_frames_go_in_and_come_out(adjusted) -> None:
    pandas = pytest.importorskip("pandas")
    again = network_from_tables(
        pandas.DataFrame(POINTS), pandas.DataFrame(observations()), points_crs="IGNF:LAMB93", angles="gon"
    ).adjust()
    assert again.sigma0 == adjusted.sigma0
    frame = again.table("observations", "pandas")
    assert frame.groupby("type")["residual"].count().to_dict() == {"Dist": 4, "Hz": 4, "Zen": 4}


def test_setups_and_switched_off_rows_are_told_apart() -> None:
    network = made(observations={"setup": [1] * 3 + [2] * 3 + [1] * 6, "active": [True] * 11 + [False]})
    assert len(network.book.stations) == 3
    assert network.book.observations.active.tolist() == [True] * 11 + [False]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observations": {"sigma": [0.0] * 12}}, "row 1 .PtA -> PtB.*not positive"),
        ({"observations": {"type": ["Hz"] * 11 + ["Foo"]}}, "row 12 .PtD -> PtC.*type 'Foo' is unknown"),
        (
            {"observations": {"value": ["x"] + [1.0] * 11}},
            "row 1 .PtA -> PtB.: column value: 'x' is not",
        ),
        ({"observations": {"valeur": [1.0] * 12}}, "observations: column valeur is unknown"),
        ({"observations": {"orientation": ["UP"] * 12}}, "orientation 'UP' is none of"),
        ({"name": ["PtA", "PtB", "PtA", "PtD"]}, "point PtA is given twice"),
        ({"sx": [-1.0, None, None, 0.001]}, "row 1 .PtA.: a sigma is empty .free., 0 .held. or positive"),
        ({"x": [1.0]}, "different lengths: name 4, x 1"),
        ({"observations": {"sigma": "x"}}, "row 1 .PtA -> PtB.: column sigma: 'x' is not a number"),
    ],
)
def test_what_is_wrong_in_a_table_is_named(changes, message) -> None:
    with pytest.raises(InputError, match=message):
        made(**changes)


def test_a_column_of_one_value_has_it_in_all_rows() -> None:
    single, listed = (made(observations={"sigma": sigma}) for sigma in (0.002, [0.002] * 12))
    assert single.book.observations.sigmas.tolist() == listed.book.observations.sigmas.tolist()
    with pytest.raises(InputError, match="at least one must be a list"):
        network_from_tables({"name": "A"}, {"type": "Dist"})


def test_a_notebook_shows_the_network_and_its_adjustment(adjusted) -> None:
    before = made()._repr_html_()
    assert "4 points (2 known), 12 observations" in before
    assert before.count('class="station"') == 2
    after = adjusted._repr_html_()
    for words in ("too large", "<ellipse", "redundancy", "normalised", "PtC"):
        assert words in after
    assert "<script" not in before + after


def test_instruments_are_named_in_a_column() -> None:
    names = ["TS 15"] * 6 + [None] * 6
    book = made(observations={"instrument": names}).book
    assert [book.groups[k].name if k >= 0 else None for k in book.observations.groups] == names


@pytest.mark.parametrize(
    ("column", "cell", "said"),
    [
        ("value", None, r"row 2 \(PtA -> PtB\): column value is empty"),
        ("value", float("nan"), r"row 2 \(PtA -> PtB\): column value is empty"),
        ("sigma", float("nan"), r"row 2 \(PtA -> PtB\): column sigma is empty"),
        ("value", float("inf"), "column value: 'inf' is not a finite number"),
        ("value", 4000.0, r"row 2 \(PtA -> PtB\): the zenith angle is beyond one turn"),
        ("to", None, "it needs 2 different points"),
        ("to", "PtA", "it needs 2 different points"),
    ],
)
def test_cells_that_must_hold_something_are_named(column, cell, said):
    table = observations()
    table[column][1] = cell
    with pytest.raises(InputError, match=said):
        made(observations=table)


@pytest.mark.parametrize(
    ("column", "cells", "said"),
    [
        ("x", [np.nan, 657710.0, 657710.0, 657700.0], r"row 1 \(PtA\): a coordinate that is not given has a"),
        ("name", ["PtA", None, "PtC", "PtD"], "row 2: a point has no name"),
        ("sz", [np.inf, None, None, 0.001], "column sz: 'inf' is not a finite number"),
    ],
)
def test_points_that_say_too_little_are_named(column, cells, said):
    with pytest.raises(InputError, match=said):
        made(**{column: cells})


def test_rows_are_switched_off_by_numbers_and_by_words():
    switches = [0, "0", "no", False, 1, "1", "yes", True, None, float("nan"), "", 1.0]
    rows = made(observations={"active": switches}).book.observations
    assert rows.active.tolist() == [False] * 4 + [True] * 8
    with pytest.raises(InputError, match=r"row 1 \(PtA -> PtB\): active is 'off'; 1 or 0 is needed"):
        made(observations={"active": ["off"] + [1] * 11})


def test_set_ups_of_one_point_with_different_orientations_are_different():
    names = ["FIX"] * 3 + ["VERT"] * 9
    stations = made(observations={"orientation": names}).book.stations
    assert len(stations.origins) == 3


def test_an_azimuth_needs_no_orientation():
    table = observations()
    table = {
        name: [*cells, *more]
        for (name, cells), more in zip(
            table.items(), (["Azim"], ["PtA"], ["PtC"], [50.0], [0.001]), strict=True
        )
    }
    book = made(observations=table).book
    kinds = [int(book.stations.orientations[k]) for k in book.observations.stations[[0, 12]]]
    assert kinds == [int(Orientation.VERT), int(Orientation.FIX)]


def test_rows_that_are_no_columns_are_refused():
    with pytest.raises(InputError, match="a data frame or a dictionary of columns is wanted, not list"):
        network_from_tables([["PtA", 0.0, 0.0, 0.0]], observations())


class NAType:
    """As `pandas.NA`: its comparisons have no truth."""

    def __eq__(self, other: object) -> "NAType":  # type: ignore[override]
        return self

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise TypeError("boolean value of NA is ambiguous")


def test_what_pandas_has_for_missing_values_is_missing():
    plain, other = made(sz=[None, None, None, 0.001]), made(sz=[NAType(), NAType(), NAType(), 0.001])
    np.testing.assert_array_equal(other.points.sigmas, plain.points.sigmas)
