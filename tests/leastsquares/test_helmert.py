"""A network in Helmert blocks is the network at once, also when a worker has lost its leaves."""

from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from obseq.codegen.ondemand import compile_formula
from obseq.errors import InputError
from obseq.formulas import Formula
from obseq.formulas.blocks import Length, Point3, norm
from obseq.leastsquares import LeastSquares, solve_in_blocks
from obseq.leastsquares.helmert.cutting import cut, homes
from obseq.survey import Network
from obseq.survey.equations.equations import Equations


def network(n=12):
    """A square of points measured from plumb stations on every other one: directions, zeniths, distances."""
    rng = np.random.default_rng(3)
    system = LeastSquares()
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) * 100.0
    true = np.column_stack([grid + rng.uniform(-20, 20, grid.shape), rng.uniform(0, 30, len(grid))])
    points = system.add_points([f"P{k}" for k in range(len(true))], true + rng.normal(0, 0.05, true.shape))
    system.add_prior(points[[0, n - 1, -1]], true[[0, n - 1, -1]], [0.01, 0.01, 0.02])
    origins = np.arange(0, len(true), 2)
    turns = system.add_rotations([f"R{k}" for k in origins], np.tile(np.eye(3), (len(origins), 1, 1)))
    system.freeze(turns, ["rotation.x", "rotation.y"])
    near = np.linalg.norm(true[origins][:, None] - true[None], axis=2)
    station, target = np.nonzero((near < 250.0) & (near > 0.0))
    east, north, up = (true[target] - true[origins[station]]).T
    observed = {
        "TopoHz": [np.arctan2(east, north)],
        "TopoZen": [np.zeros(len(up)), np.arctan2(np.hypot(east, north), up)],
    }
    blocks = {
        "station.centre": points[origins[station]],
        "station.rotation": turns[station],
        "target": points[target],
    }
    for formula, columns in observed.items():
        columns[-1] += rng.normal(0, 1e-5, len(up))
        system.add(formula, blocks, np.column_stack(columns), 1e-5)
    lengths = np.sqrt(east**2 + north**2 + up**2) + rng.normal(0, 0.002, len(up))
    system.add("Dist3D", {"p1": points[origins[station]], "p2": points[target]}, lengths[:, None], 0.002)
    return system, points, turns


class Here:
    """Does each task at once; a subclass may spoil something before."""

    def submit(self, function, *arguments):
        self.before(Path(arguments[0]))
        future = Future()
        future.set_result(function(*arguments))
        return future

    def before(self, part):
        """Called with the file of a part."""


class Losing(Here):
    """Has lost what became of a leaf before each task."""

    def before(self, part):
        for file in part.parent.glob(f"{part.stem}.[0-9]*"):
            file.unlink()


class Twice(Here):
    """Does each task twice, as a scheduler does that takes a slow worker for a lost one."""

    def submit(self, function, *arguments):
        super().submit(function, *arguments)
        return super().submit(function, *arguments)


class Stopped(Here):
    """Is stopped after some tasks."""

    def __init__(self, tasks):
        self.left = tasks

    def before(self, part):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt


@pytest.mark.parametrize("executor", [None, Losing(), Twice()], ids=["here", "loses leaves", "twice"])
def test_blocks_give_what_one_machine_gives(executor, tmp_path):
    whole, points, turns = network()
    system, *_ = network()
    expected = whole.solve(covariance=True)
    found = solve_in_blocks(system, 2, executor, folder=tmp_path)
    assert found.converged
    assert found.redundancy == expected.redundancy
    assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-9)
    assert np.abs(system.values(points) - whole.values(points)).max() < 1e-9
    assert np.abs(system.values(turns) - whole.values(turns)).max() < 1e-12
    assert np.allclose(found.variances, expected.cofactors.variances(), rtol=1e-8, atol=0.0)
    assert len(found.separators) == 3
    assert min(found.separators) > 0
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("tasks", [0, 3, 4, 7, 9])
def test_a_run_that_was_stopped_leaves_nothing_to_one_with_corrected_observations(tmp_path, tasks):
    wrong, *_ = network(8)
    lengths = wrong.batches[-1]
    lengths.observations = lengths.observations[:, 0] + 0.01
    with pytest.raises(KeyboardInterrupt):
        solve_in_blocks(wrong, 2, Stopped(tasks), folder=tmp_path)
    whole, points, _ = network(8)
    system, *_ = network(8)
    found = solve_in_blocks(system, 2, folder=tmp_path)
    assert found.sigma0 == pytest.approx(whole.solve().sigma0, rel=1e-9)
    assert np.abs(system.values(points) - whole.values(points)).max() < 1e-9


def test_a_network_with_known_coordinates(tmp_path):
    """Its system has linear rows: the known coordinates."""
    rng = np.random.default_rng(5)
    names, places = [f"P{k}" for k in range(10)], rng.uniform(0.0, 100.0, (10, 3))
    known = ["0.002 0.003 0.004" if k % 3 == 0 else "" for k in range(10)]
    lines = [
        " ".join(["1" if sigmas else "0", name, *map(str, place), sigmas])
        for name, place, sigmas in zip(names, places, known, strict=True)
    ]
    (tmp_path / "n.cor").write_text("\n".join(lines) + "\n")
    lengths = np.linalg.norm(places[:, None] - places, axis=2) + rng.normal(0.0, 0.01, (10, 10))
    sights = [f"3 {names[a]} {names[b]} {lengths[a, b]} 0.01" for a in range(10) for b in range(a)]
    (tmp_path / "n.obs").write_text("\n".join(sights) + "\n")
    read = Network.read(tmp_path / "n.obs", tmp_path / "n.cor")

    def equations():
        initial = read.fieldwork.initial_values()
        return Equations(read.frame, read.point_system, read.points, read.book, initial)

    whole, parts = equations(), equations()
    expected, found = whole.system.solve(covariance=True), solve_in_blocks(parts.system, 2)
    assert found.redundancy == expected.redundancy
    assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-9)
    differences = parts.system.values(parts.points) - whole.system.values(whole.points)
    assert np.abs(differences).max() < 1e-8
    assert np.allclose(found.variances, expected.cofactors.variances(), rtol=1e-6, atol=0.0)


class Doubled(Formula):
    """Twice a distance, minus what was measured."""

    def residual(self, p1: Point3, p2: Point3, *, twice: Length):
        """The residual (m)."""
        return 2 * norm(p2 - p1) - twice


@pytest.mark.slow  # a process that imports everything
def test_a_formula_of_ones_own_goes_to_the_workers_with_its_text():
    kernel = compile_formula(Doubled())

    def doubled():
        system, points, _ = network(6)
        distances = system.batches[-1]
        system.add(
            kernel, {"p1": distances.blocks[0], "p2": distances.blocks[1]}, 2.0 * distances.observations, 0.01
        )
        return system, points

    (whole, points), (parts, _) = doubled(), doubled()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = solve_in_blocks(parts, 1, pool)
    assert found.sigma0 == pytest.approx(whole.solve().sigma0, rel=1e-9)
    assert np.abs(parts.values(points) - whole.values(points)).max() < 1e-9


def test_iterations_end_at_their_number():
    system, *_ = network(6)
    found = solve_in_blocks(system, 1, max_iterations=1)
    assert not found.converged
    assert len(found.costs) == 2
    assert found.costs[1] < found.costs[0]


def test_every_observation_is_in_one_part():
    system, *_ = network()
    parts = cut(system, 3).parts
    total = sum(len(observations) for part in parts for _, _, observations, _ in part.batches)
    assert total == system.n_observations
    assert sum(np.isfinite(sigmas).sum() for part in parts for *_, sigmas in part.priors) == 9


def test_a_block_is_at_home_below_all_its_observations():
    # Leaves 4 to 7: a block of leaf 5 alone; of 4 and 5 (node 2); of 5 and 6 (the root).
    touched = np.array([[0, 1, 0], [1, 1, 1], [0, 0, 1], [0, 0, 0]], dtype=bool)
    assert homes(touched).tolist() == [5, 2, 1]


def test_what_cannot_be_cut_is_refused():
    system, points, _ = network(4)
    with pytest.raises(InputError, match="halved"):
        solve_in_blocks(system, 9)
    system.batches[0].loss = "huber"
    with pytest.raises(InputError, match="TopoHz has a loss"):
        solve_in_blocks(system, 1)
    system.batches[0].loss = None
    system.constrain("Dist3D", {"p1": points[:1], "p2": points[1:2]}, [[100.0]])
    with pytest.raises(InputError, match="hard constraints"):
        solve_in_blocks(system, 1)
