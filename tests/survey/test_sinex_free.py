"""SINEX files of free networks: what is written is read again, as free as it was."""

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.conversion import write_sinex
from obseq.formats.sinex.normals import reduced
from obseq.survey import Datum, Network, Quality, network_from_tables
from obseq.survey.planning.simulation import Simulation

RTL = "RTL*657700*6860700*0*IGNF:LAMB93"
PLACES = {"AAAA": (0, 0, 0), "BBBB": (400, 30, 8), "CCCC": (350, 420, -6), "DDDD": (-60, 300, 25)}
INNER = Datum("inner")


def free_network(seed=3):
    """Rounds, zenith angles and distances between four points, none of which is known."""
    points = {"name": list(PLACES)}
    for k, axis in enumerate("xyz"):
        points[axis] = [float(place[k]) for place in PLACES.values()]
    rows = [(kind, a, b) for a in PLACES for b in PLACES if a != b for kind in ("Hz", "Zen", "Dist")]
    of_kind, starts, ends = map(list, zip(*rows, strict=True))
    sigmas = [0.002 if kind == "Dist" else 1e-5 for kind in of_kind]
    table = {"type": of_kind, "from": starts, "to": ends, "value": [1.0] * len(rows), "sigma": sigmas}
    return Simulation(network_from_tables(points, table, frame=RTL)).drawn(np.random.default_rng(seed))


def geocentric(adjustment):
    from obseq import crs

    rotation, translation = crs.parse(adjustment.frame).geocentric_pose()
    return adjustment.points.coordinates @ rotation.T + translation, rotation


@pytest.fixture(scope="module")
def adjusted():
    return free_network().adjust(datum=INNER)


@pytest.fixture
def written(adjusted, tmp_path):
    write_sinex(tmp_path / "free.snx", adjusted)
    return tmp_path / "free.snx"


def test_a_free_network_comes_back_with_its_defect(adjusted, written):
    again = Network.read_project(written)
    assert len(again.book.observations) == 12 - 4  # rotation about the vertical, and a place
    result = again.adjust(datum=INNER)
    assert result.solution.redundancy == 0
    places, rotation = geocentric(adjusted)
    found, turned = geocentric(result)
    np.testing.assert_allclose(found, places, rtol=0, atol=1e-7)
    before = rotation @ adjusted.points.covariances @ rotation.T
    np.testing.assert_allclose(
        turned @ result.points.covariances @ turned.T, before, rtol=0, atol=1e-5 * before.max()
    )


def test_it_is_written_as_normal_equations_without_constraints(written):
    text = written.read_text()
    assert max(map(len, text.splitlines())) <= 80
    blocks = ("APRIORI", "NORMAL_EQUATION_VECTOR", "NORMAL_EQUATION_MATRIX L", "MATRIX_ESTIMATE L COVA")
    for block in blocks:
        assert f"\n+SOLUTION/{block}\n" in text
        assert f"\n-SOLUTION/{block}\n" in text


def test_known_points_place_it_as_they_place_the_observations(adjusted, written, tmp_path):
    """Two files: the free network, and three known points; together as one adjustment of all."""
    places, _ = geocentric(adjusted)
    lines = ["%=SNX 2.02 AGY 20:001:00000 AGY 20:001:00000 20:001:00000 P 00009 2 S", "+SOLUTION/ESTIMATE"]
    known = places[:3] + np.random.default_rng(1).normal(0.0, 0.004, (3, 3))
    for k, value in enumerate(known.ravel()):
        name = list(PLACES)[k // 3]
        head = f" {k + 1:5d} STA{'XYZ'[k % 3]}   {name}  A    1 26:326:00000 m    2"
        lines.append(f"{head} {value:21.14E} {0.004:11.5E}")
    lines += ["-SOLUTION/ESTIMATE", "+SOLUTION/MATRIX_ESTIMATE L COVA"]
    lines += [f" {k + 1:5d} {k + 1:5d} {0.004**2:21.14E}" for k in range(9)]
    (tmp_path / "known.snx").write_text("\n".join([*lines, "-SOLUTION/MATRIX_ESTIMATE", "%ENDSNX"]) + "\n")
    text = written.read_text()
    stamp = text.split("STAX")[1].split()[3]
    written.write_text(text.replace(stamp, "26:326:00000"))
    both = Network.read_project([written, tmp_path / "known.snx"]).adjust(quality=Quality(a_priori=True))
    assert both.solution.redundancy == 9 - 4
    covariance = np.zeros((12, 12))
    turn = np.kron(np.eye(4), geocentric(adjusted)[1])
    ids = adjusted.solution.table.find(list(PLACES), "Point3")
    covariance = turn @ adjusted.solution.covariance_between(ids, ids) @ turn.T
    normals = np.linalg.pinv(covariance, rcond=1e-9, hermitian=True)
    weights = np.diag([0.004**-2] * 9 + [0.0] * 3)
    offsets = np.append((known - places[:3]).ravel(), np.zeros(3))
    step = np.linalg.solve(normals + weights, weights @ offsets)
    found, rotation = geocentric(both)
    np.testing.assert_allclose((found - places).ravel(), step, rtol=0, atol=1e-7)
    inverse = np.linalg.inv(normals + weights)[9:, 9:]
    np.testing.assert_allclose(
        rotation @ both.points.covariances[3] @ rotation.T, inverse, rtol=1e-5, atol=1e-12
    )


def test_other_parameters_are_eliminated():
    design = np.random.default_rng(0).normal(size=(9, 5))
    observed = np.random.default_rng(1).normal(size=9)
    matrix, vector = design.T @ design, design.T @ observed
    small, right = reduced(matrix, vector, np.array([0, 2]))
    np.testing.assert_allclose(np.linalg.solve(small, right), np.linalg.solve(matrix, vector)[[0, 2]])
    np.testing.assert_allclose(np.linalg.inv(small), np.linalg.inv(matrix)[np.ix_([0, 2], [0, 2])])


def test_normal_equations_alone_are_enough(adjusted, written):
    text = written.read_text()
    first, rest = text.split("+SOLUTION/ESTIMATE\n")
    rest = rest.split("-SOLUTION/MATRIX_ESTIMATE L COVA\n")[1]
    written.write_text(first + rest)
    found, _ = geocentric(Network.read_project(written).adjust(datum=INNER))
    np.testing.assert_allclose(found, geocentric(adjusted)[0], rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("SOLUTION/NORMAL_EQUATION_VECTOR", "SOLUTION/OTHER"), "NORMAL_EQUATION_MATRIX with L or U and"),
        (("SOLUTION/APRIORI", "SOLUTION/OTHER"), "has no block SOLUTION/APRIORI"),
        (("NORMAL_EQUATION_MATRIX L", "NORMAL_EQUATION_MATRIX X"), "MATRIX with L or U"),
        (
            ("SOLUTION/NORMAL_EQUATION", "SOLUTION/OTHER"),
            "not positive definite; that of a free network needs",
        ),
    ],
)
def test_what_is_missing_of_normal_equations_is_named(written, change, message, capsys):
    written.write_text(written.read_text().replace(*change))
    with pytest.raises(InputError, match=message):
        Network.read_project(written)
    assert main(["adjust", str(written)]) == 2
    capsys.readouterr()


def test_a_datum_of_some_points_is_refused(tmp_path):
    partly = free_network().adjust(datum=Datum("inner", ("AAAA", "BBBB")))
    with pytest.raises(InputError, match="SINEX: point CCCC does not carry the datum of this free network"):
        write_sinex(tmp_path / "no.snx", partly)
