"""A GNSS vector, or a position, is one observation: tested as a whole, named as a whole."""

import re

import numpy as np
import pytest

from obseq.report import listing, summary
from obseq.report.content import content
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


@pytest.fixture
def adjusted(tmp_path):
    """Adjusts local vectors of which one is off along the vertical; covariances are those of the axes."""

    def run(lift=0.0, seed=3, pair="K2 A", **options):
        chance, covariance = np.random.default_rng(seed), axes().T @ np.diag(np.square(SIGMAS)) @ axes()
        lines = ["type,from,to,value,sigma,cluster,covariances"]
        for number, ends in enumerate(PAIRS):
            a, b = ends.split()
            value = np.subtract(PLACES[b], PLACES[a]) + chance.multivariate_normal(np.zeros(3), covariance)
            value = value + (lift * UP if ends == pair else 0.0)
            for k, name in enumerate(("LX", "LY", "LZ")):
                others = " ".join(f"{covariance[k, j]:.9e}" for j in range(k))
                sigma = covariance[k, k] ** 0.5
                lines.append(f"{name},{a},{b},{value[k]:.5f},{sigma:.7f},{number},{others}")
        (tmp_path / "v.csv").write_text("\n".join(lines))
        rows = [
            f"{n},{x},{y},{z},{'0.003,0.003,0.005' if 'K' in n else ',,'}" for n, (x, y, z) in PLACES.items()
        ]
        (tmp_path / "p.csv").write_text("\n".join(["name,x,y,z,sx,sy,sz", *rows]))
        network = Network.read_project([tmp_path / "p.csv", tmp_path / "v.csv"])
        return network.adjust(quality=Quality(**options))

    return run


def test_a_wrong_antenna_height_is_named_though_no_component_stands_out(adjusted):
    adjustment = adjusted(0.1)
    record = adjustment.record()
    sizes = [abs(row.standardised_residual) for row in record.observations]
    assert max(sizes) < record.reliability.critical
    assert re.match(r"vector K2 -> A \(.*v\.csv:11\)", record.suspicion.observations[0])
    assert not adjustment.is_complete and not Verdict(record).types_beyond
    assert record.suspicion.blunder == pytest.approx(0.1, abs=0.03)
    assert np.array(record.suspicion.blunders) @ UP == pytest.approx(0.1, abs=0.03)


def test_without_it_nothing_is_suspected_and_no_type_is_blamed(adjusted):
    for seed in range(1, 4):
        record = adjusted(seed=seed).record()
        assert record.suspicion is None
        assert not any(row.sigma_factor > row.upper for row in Verdict(record).types_beyond)


def test_reports_list_the_vectors_with_test_and_limit(adjusted):
    record = adjusted(0.1).record()
    worst = max(record.joint, key=lambda item: item.statistic)
    assert worst.what == "vector K2 -> A" and worst.rows == (9, 10, 11) and worst.is_beyond
    assert worst.level == pytest.approx(0.0055, abs=1e-4)
    count = sum(item.statistic > 12.63 for item in record.joint)
    assert f"limit of T 12.63 (at 0.55 %), exceeded by {count} of 8, the worst" in summary(record)
    assert f"{worst.statistic:.2f}" in listing(record)
    table = next(item for item in content(record)["tables"] if item["id"] == "vectors")
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
    assert "T of its vector" in summary(record) and record.suspicion is None


def test_two_known_heights_that_explain_as_much_are_both_named(adjusted, tmp_path):
    adjusted()
    path = tmp_path / "p.csv"
    path.write_text(path.read_text().replace("K1,0,0,0,", "K1,0,0,0.09,"))
    names = Network.read_project([path, tmp_path / "v.csv"]).adjust().suspicion.observations
    assert {name.split(" (")[0] for name in names} == {"known z of K1", "known z of K2"}
