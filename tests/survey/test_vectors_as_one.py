"""A GNSS vector, or a position, is one observation: tested as a whole, named as a whole."""

from functools import cache

import numpy as np
import pytest
from msgspec import structs

from obseq.crs import parse
from obseq.report.adjusted import outcome
from obseq.report.summary import listing, summary
from obseq.report.tables.content import numbers_of, tables
from obseq.report.verdict import Verdict
from obseq.survey import Network, Quality

PLACES = {
    "K1": (0, 0, 0),
    "K2": (7600, 1800, 40),
    "A": (2900, 5000, 90),
    "B": (4700, -1500, -20),
    "C": (1200, 2400, 25),
}
PAIRS = ["K1 A", "K1 C", "K1 B", "K2 A", "K2 B", "A C", "B C", "K1 K2"]
UP = np.array([0.6, 0.1, 0.79]) / np.linalg.norm([0.6, 0.1, 0.79])
SIGMAS = 0.004, 0.004, 0.012


def axes():
    """East, north and up, as rows, along the axes of the vectors."""
    east = np.cross([0.0, 0.0, 1.0], UP) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], UP))
    return np.array([east, np.cross(UP, east), UP])


@pytest.fixture(scope="module")
def tmp_path(tmp_path_factory):
    """One folder for all: what was adjusted is kept."""
    return tmp_path_factory.mktemp("vectors")


def write(folder, lift=0.0, *pairs, seed=3, along="mean", is_bare=False):
    """Local vectors of which some are off along one direction; covariances are those of the axes."""
    direction = {"mean": UP, "up": np.array([0.0, 0.0, 1.0]), "east": np.array([1.0, 0.0, 0.0])}[along]
    chance, covariance = np.random.default_rng(seed), axes().T @ np.diag(np.square(SIGMAS)) @ axes()
    lines = ["type,from,to,value,sigma,cluster,covariances"]
    for number, ends in enumerate(PAIRS):
        a, b = ends.split()
        value = np.subtract(PLACES[b], PLACES[a]) + chance.multivariate_normal(np.zeros(3), covariance)
        value = value + (lift * direction if ends in (pairs or ["K2 A"]) else 0.0)
        for k, name in enumerate(("LX", "LY", "LZ")):
            others = " ".join(f"{covariance[k, j]:.9e}" for j in range(k))
            sigma = covariance[k, k] ** 0.5
            lines.append(f"{name},{a},{b},{value[k]:.5f},{sigma:.7f},{number},{others}")
    lines = [line.rsplit(",", 2)[0] for line in lines] if is_bare else lines
    (folder / "v.csv").write_text("\n".join(lines))
    rows = [f"{n},{x},{y},{z},{'0.003,0.003,0.005' if 'K' in n else ',,'}" for n, (x, y, z) in PLACES.items()]
    (folder / "p.csv").write_text("\n".join(["name,x,y,z,sx,sy,sz", *rows]))
    return folder / "p.csv", folder / "v.csv"


@pytest.fixture(scope="module")
def adjusted(tmp_path):
    """Adjusts what `write` writes; what was adjusted is kept."""

    @cache
    def run(*lifted, seed=3, along="mean", is_bare=False, **options):
        files = write(tmp_path, *lifted, seed=seed, along=along, is_bare=is_bare)
        return Network.read_project(files).adjust(quality=Quality(**options))

    return run


def test_a_wrong_antenna_height_is_named_though_no_component_stands_out(adjusted):
    adjustment = adjusted(0.1)
    record = adjustment.record()
    sizes = [abs(row.standardised_residual) for row in record.observations]
    assert max(sizes) < record.reliability.critical
    (error,) = adjustment.gross_errors
    assert {row.line for row in error.observations} == {11, 12, 13}
    assert {one.code for one in (error, *error.others)} <= {"S170", "S171"}
    assert not adjustment.is_complete and not Verdict(record).types_beyond


def test_without_it_nothing_is_suspected_and_no_type_is_blamed(adjusted):
    record = adjusted().record()
    assert record.gross_errors == () and record.diagnosis.status == "accepted"
    assert not any(row.sigma_factor > row.upper for row in Verdict(record).types_beyond)


def test_reports_list_the_vectors_with_test_and_limit(adjusted):
    record = adjusted(0.1).record()
    worst = max(record.joint, key=lambda item: item.statistic)
    assert worst.what == "vector K2 -> A" and worst.rows == (9, 10, 11) and worst.is_beyond
    assert worst.level == pytest.approx(0.0055, abs=1e-4)
    count = sum(item.statistic > 12.63 for item in record.joint)
    told = " ".join(summary(outcome(structs.replace(record, diagnosis=None))).split())
    assert f"limit 12.63 with 3 degrees of freedom; {count} of 8 are" in told
    assert f"{worst.statistic:.2f}" in listing(outcome(record))
    table = next(item for item in tables(record, numbers_of(record)) if item["id"] == "vectors")
    assert len(table["columns"][0]["values"]) == len(PAIRS)
    assert type(record).from_dict(record.to_dict()).joint == record.joint


def test_the_sum_of_squares_of_vectors_is_that_of_all_their_components(adjusted):
    record = adjusted().record()
    rows = {row.name: row for row in record.types}
    known = sum(row.normalised_residual**2 for row in record.constraints)
    whole = rows["LX LY LZ"]
    squares = whole.sigma_factor**2 * whole.redundancy
    assert squares == pytest.approx(record.variance_factor * record.redundancy - known, rel=1e-6)
    assert whole.upper is not None
    assert all(rows[name].sigma_factor is None and rows[name].upper is None for name in ("LX", "LY", "LZ"))


def test_snooping_tests_and_leaves_out_the_vector(adjusted):
    record = adjusted(0.1, snooping="w").record()
    (gone,) = record.rejections
    assert gone.row in (9, 10, 11) and gone.companions == 2 and gone.degrees == 3
    assert "T of its vector" in summary(outcome(record))


def test_two_known_heights_that_explain_as_much_are_both_named(tmp_path):
    path, _ = write(tmp_path, seed=2)
    path.write_text(path.read_text().replace("K1,0,0,0,", "K1,0,0,0.09,"))
    (error,) = Network.read_project([path, tmp_path / "v.csv"]).adjust().gross_errors
    told = [(one.code, {point.name for point in one.points}) for one in (error, *error.others)]
    assert ("S110", {"K1"}) in told and ("S110", {"K2"}) in told


def test_a_vector_that_is_wrong_by_much_is_no_wrong_digit_of_components(adjusted):
    (error,) = adjusted(0.6).gross_errors
    assert error.code in ("S170", "S171") and {row.line for row in error.observations} == {11, 12, 13}
    if error.code == "S170":
        assert np.array(error.size) == pytest.approx(0.6 * UP, abs=0.04)


def test_several_vectors_of_one_station_that_share_the_height_of_its_antenna_are_named(adjusted):
    found = adjusted(-0.1, "K1 A", "K1 C", along="up").gross_errors
    told = {row.line for error in found for one in (error, *error.others) for row in one.observations}
    assert {2, 5} <= told


def test_a_vector_without_covariance_is_one_observation_too(adjusted):
    record = adjusted(0.2, is_bare=True).record()
    assert [item.rows for item in record.joint] == [(k, k + 1, k + 2) for k in range(0, 24, 3)]
    (error,) = record.gross_errors
    assert {row.line for row in error.observations} == {11, 12, 13} and not Verdict(record).types_beyond
    assert [row.name for row in record.types] == ["LX", "LY", "LZ"]


def test_a_known_point_beside_all_its_vectors_is_named_as_that(tmp_path):
    files = write(tmp_path, is_bare=True)
    files[0].write_text(files[0].read_text().replace("K1,0,0,0,", "K1,0.07,0.07,0,"))
    (error,) = Network.read_project(files).adjust().gross_errors
    told = [{point.name for point in one.points} for one in (error, *error.others)]
    assert {"K1"} in told and {"K2"} in told


def test_where_the_sigmas_are_too_small_no_vector_is_blamed(tmp_path):
    _, path = write(tmp_path, seed=5)
    lines = path.read_text().splitlines()
    scaled = [lines[0]]
    for line in lines[1:]:
        *start, sigma, cluster, others = line.split(",")
        less = " ".join(f"{float(one) / 16:.9e}" for one in others.split())
        scaled.append(",".join([*start, f"{float(sigma) / 4:.8f}", cluster, less]))
    path.write_text("\n".join(scaled))
    record = Network.read_project([tmp_path / "p.csv", path]).adjust().record()
    assert not record.gross_errors
    assert [row.name for row in Verdict(record).types_beyond] == ["LX LY LZ"]


HOMES = {"K1": (0, 0), "K2": (7600, 1800), "K3": (2900, 6000), "A": (4700, -1500), "B": (1200, 2400)}
LINKS = ["K1 A", "K1 B", "K2 A", "K2 K3", "K3 B", "A B", "K1 K2", "K3 A"]


@pytest.fixture(scope="module")
def mapped(tmp_path):
    """Adjusts geocentric vectors; heights of known points are lowered by what a function of (x, y) says."""

    def run(lowered=lambda x, y: 0.0, crs="EPSG:25832"):
        chance = np.random.default_rng(4)
        given = {name: (455000.0 + x, 5410000.0 + y, 300.0) for name, (x, y) in HOMES.items()}
        points = parse("EPSG:25832").to_geocentric(list(given.values()))
        places = dict(zip(given, points, strict=True))
        lines = ["type,from,to,value,sigma,cluster,covariances"]
        for number, ends in enumerate(LINKS):
            a, b = ends.split()
            value = places[b] - places[a] + chance.normal(0.0, 0.005, 3)
            lines += [f"V{'XYZ'[k]},{a},{b},{value[k]:.5f},0.005,{number},{'0 ' * k}" for k in range(3)]
        (tmp_path / "v.csv").write_text("\n".join(lines))
        rows = ["name,x,y,z,sx,sy,sz"]
        for name, (x, y, z) in given.items():
            sigmas = "0.003,0.003,0.005" if "K" in name else ",,"
            rows.append(f"{name},{x},{y},{z - lowered(*HOMES[name])},{sigmas}")
        (tmp_path / "p.csv").write_text("\n".join(rows))
        return Network.read_project([tmp_path / "p.csv", tmp_path / "v.csv"], points_crs=crs).adjust()

    return run
