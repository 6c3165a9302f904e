"""What is said of small networks: precisions without misclosure, what is known, sigmas in another unit."""

import pytest

from obseq.errors import InputError
from obseq.report.adjusted import outcome
from obseq.report.summary import summary
from obseq.survey import Network

MARKS = ["5 BM1 0 0 100 0.0005", "4 L1 0 0 101", "4 L2 0 0 101"]
LOOP = ["4 BM1 L1 1.2340 0.001", "4 L1 L2 0.5670 0.001", "4 L2 BM1 -1.801 0.001", "4 L1 BM1 -1.234 0.001"]


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def network(marks: list[str], lines: list[str]) -> Network:
        (tmp_path / "p.cor").write_text("\n".join(marks))
        (tmp_path / "o.obs").write_text("\n".join(lines))
        return Network.read("o.obs", "p.cor")

    return network


def told(network: Network) -> str:
    return summary(outcome(network.adjust().record()))


def test_a_loop_that_closes_by_chance_does_not_make_precisions_zero(read):
    adjustment = read(MARKS, LOOP).adjust()
    assert adjustment.sigma0 < 1e-9 and adjustment.precision == "a priori"
    by_hand = 1e-6 / (1 + 1 + 1 / 2) + 0.0005**2  # two lines, the way over L2, the bench mark
    assert adjustment.covariance("L1")[2, 2] == pytest.approx(by_hand, rel=1e-6)
    assert "Precisions are those of the given sigmas" in summary(outcome(adjustment.record()))
    off = read(MARKS, [*LOOP[:3], "4 L1 BM1 -1.2341 0.001"]).adjust()
    assert off.precision == "a posteriori" and "Precisions are scaled by it" in summary(outcome(off.record()))


def test_points_are_known_where_nothing_of_them_is_unknown_and_something_observes_them(read):
    spare = [*MARKS, "5 FAR 900 0 100 9.0"]
    text = told(read(spare, LOOP))
    assert "4 points, 1 known" in text
    (card,) = (line for line in text.splitlines() if "weakest point  " in line)
    assert card.split()[2:4] == ["0.92", "mm"]  # 1 / (1 + 1 / 1.5) mm², and the bench mark
    assert card.endswith("standard deviation of its height")
    assert "is the weakest point: Standard deviation of its height 0.92 mm." in text


def test_a_levelled_point_has_no_ellipse(read):
    adjustment = read(MARKS, LOOP).adjust()
    assert [point.ellipse for point in adjustment.record().points] == [None, None, None]
    with pytest.raises(InputError, match="L1 has no ellipse: its x and y are held"):
        adjustment.ellipse("L1")


def test_a_sigma_in_millimetres_among_few_is_told_with_its_line(read):
    assert "the sigma of DH BM1 -> L1 (o.obs:1) is 1 m" in told(read(MARKS, ["4 BM1 L1 1.234 1", *LOOP[1:]]))
    assert "next to no weight" in told(read(MARKS[:2], [LOOP[0], "4 L1 BM1 -1.234 0.5"]))
    assert "next to no weight" not in told(read(MARKS, ["4 BM1 L1 1.234 0.2", *LOOP[1:]]))


def test_the_two_sigma0_are_named_apart(read):
    network = read(
        ["5 BM1 0 0 100 0.005", "5 BM2 0 0 101 0.001", *MARKS[1:]], ["4 BM2 L1 0.2385 0.001", *LOOP]
    )
    record = network.adjust().record()
    assert abs(record.global_test.sigma0 - record.sigma0) > 1e-4
    (card,) = (
        line for line in summary(outcome(record)).splitlines() if "expected" in line and "% chi" in line
    )
    assert card.endswith(f"; {record.sigma0:.4g} of observations alone")
