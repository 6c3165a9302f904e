"""Covariances across kinds of observations, against an adjustment with dense matrices."""

import numpy as np
import pytest

from obseq.formats.conversion import write_gama
from obseq.survey import Network

GON, CC, MM = np.pi / 200, np.pi / 2e6, 1e-3
KNOWN = {"A": (0.0, 0.0, 10.0), "B": (0.0, 100.0, 12.0)}
START = {"P": (80.0, 40.0, 15.0), "Q": (60.0, 90.0, 18.0)}
TRUE = {"P": (80.02, 39.97, 15.03), "Q": (60.01, 90.02, 17.98)}
SIGHTS = [
    ("A", "direction", "B"),
    ("A", "direction", "P"),
    ("A", "distance", "P"),
    ("A", "direction", "Q"),
    ("A", "s-distance", "Q"),
    ("A", "z-angle", "Q"),
    ("A", "z-angle", "P"),
    ("B", "direction", "A"),
    ("B", "direction", "P"),
    ("B", "direction", "Q"),
    ("B", "s-distance", "P"),
    ("B", "s-distance", "Q"),
    ("B", "z-angle", "P"),
]
COUNTS = {"A": 7, "B": 6}


def computed(values):
    """What the sights are, at P and Q and the zeros of the two circles (8,)."""
    points = {name: np.array(xyz) for name, xyz in KNOWN.items()}
    points |= {"P": values[:3], "Q": values[3:6]}
    zeros = dict(zip("AB", values[6:], strict=True))
    rows = []
    for origin, kind, target in SIGHTS:
        east, north, up = points[target] - points[origin]
        flat = np.hypot(east, north)
        rows.append(
            {
                "direction": np.arctan2(east, north) - zeros[origin],
                "distance": flat,
                "s-distance": np.hypot(flat, up),
                "z-angle": np.arctan2(flat, up),
            }[kind]
        )
    return np.array(rows)


def units():
    return np.array([MM if "distance" in kind else CC for _, kind, _ in SIGHTS])


def covariances(chance):
    """(13, 13) mm, cc: full within each set."""
    whole = np.zeros((13, 13))
    for first, last in ((0, 7), (7, 13)):
        roots = chance.normal(size=(last - first, last - first))
        whole[first:last, first:last] = 25.0 * (roots @ roots.T / (last - first) + 0.1 * np.eye(last - first))
    return whole


def dense(observed, covariance):
    """Values, covariance and sigma0 by Gauss-Newton with numerical derivatives."""
    values = np.concatenate([START["P"], START["Q"], [0.0, 0.0]])
    weight = np.linalg.inv(covariance)
    for _ in range(12):
        steps = 1e-4 * np.eye(8)
        columns = [(computed(values + step) - computed(values - step)) / 2e-4 for step in steps]
        jacobian = np.column_stack(columns)
        gap = observed - computed(values)
        angular = units() == CC
        gap[angular] = np.remainder(gap[angular] + np.pi, 2 * np.pi) - np.pi
        normal = jacobian.T @ weight @ jacobian
        values = values + np.linalg.solve(normal, jacobian.T @ weight @ gap)
    return values, np.linalg.inv(normal), np.sqrt(gap @ weight @ gap / 5)


def written(path, observed, covariance):
    """The network as a file of Gama."""
    lines = ['<gama-local><network axes-xy="en"><parameters sigma-apr="1" /><points-observations>']
    for name, (x, y, z) in (KNOWN | START).items():
        part = 'fix="xyz"' if name in KNOWN else 'adj="xyz"'
        lines.append(f'<point id="{name}" x="{x}" y="{y}" z="{z}" {part} />')
    first = 0
    for origin, count in COUNTS.items():
        lines.append(f'<obs from="{origin}">')
        for row in range(first, first + count):
            _, kind, target = SIGHTS[row]
            value = observed[row] if "distance" in kind else observed[row] % (2 * np.pi) / GON
            lines.append(f'<{kind} to="{target}" val="{value!r}" />')
        block = covariance[first : first + count, first : first + count]
        lines.append(f'<cov-mat dim="{count}" band="{count - 1}">')
        lines += [" ".join(map(repr, block[row, row:].tolist())) for row in range(count)]
        lines += ["</cov-mat>", "</obs>"]
        first += count
    path.write_text(
        "\n".join([*lines, "</points-observations></network></gama-local>"]).replace("np.float64", "")
    )
    return path


@pytest.fixture
def network(tmp_path):
    chance = np.random.default_rng(7)
    covariance = covariances(chance)
    truth = computed(np.concatenate([TRUE["P"], TRUE["Q"], [0.3, -0.8]]))
    scaled = covariance * np.outer(units(), units())
    observed = (truth + np.linalg.cholesky(scaled) @ chance.normal(size=13)).tolist()
    return written(tmp_path / "n.gkf", observed, covariance), np.array(observed), scaled


def test_covariances_join_observations_of_several_kinds(network):
    path, observed, covariance = network
    given = Network.read_project(path, refraction=1.0)
    assert [len(cluster.rows) for cluster in given.book.clusters] == [7, 6]
    adjusted = given.adjust()
    values, cofactors, sigma0 = dense(observed, covariance)
    assert adjusted.converged
    assert adjusted.solution.redundancy == 5
    assert np.sqrt(adjusted.solution.variance_factor) == pytest.approx(sigma0, rel=1e-7)
    np.testing.assert_allclose(adjusted.points.coordinates[2:], values[:6].reshape(2, 3), atol=1e-8)
    found = adjusted.points.covariances[2]
    scale = sigma0**2 if adjusted.precision == "a posteriori" else 1.0
    np.testing.assert_allclose(found, cofactors[:3, :3] * scale, rtol=1e-5, atol=1e-14)


def test_residuals_and_redundancy_are_those_of_each_observation(network):
    path, observed, covariance = network
    adjusted = Network.read_project(path, refraction=1.0).adjust()
    values, _, _ = dense(observed, covariance)
    gap = np.remainder(computed(values) - observed + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(adjusted.residuals, gap, atol=1e-8)
    record = adjusted.record()
    assert sum(row.redundancy for row in record.observations) == pytest.approx(5.0, abs=1e-6)


def test_gama_files_keep_them(network, tmp_path):
    path, _, _ = network
    given = Network.read_project(path, refraction=1.0)
    write_gama(tmp_path / "again.gkf", given)
    again = Network.read_project(tmp_path / "again.gkf", refraction=1.0)
    assert [len(cluster.rows) for cluster in again.book.clusters] == [7, 6]
    before, after = given.adjust(), again.adjust()
    np.testing.assert_allclose(after.points.coordinates, before.points.coordinates, atol=1e-9)
    assert after.solution.variance_factor == pytest.approx(before.solution.variance_factor, rel=1e-9)


def test_a_blunder_among_them_is_announced(network, tmp_path):
    path, observed, covariance = network
    assert not Network.read_project(path, refraction=1.0).gross_errors()
    wrong = observed + 2.0 * (np.arange(len(observed)) == 4)
    blundered = written(tmp_path / "w.gkf", wrong.tolist(), covariance / np.outer(units(), units()))
    assert Network.read_project(blundered, refraction=1.0).gross_errors()
