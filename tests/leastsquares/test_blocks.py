"""A system in blocks is the system at once, in all that is solved and said; stopped runs are taken up."""

import errno
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

import numpy as np
import pytest
from networks import mixed_system

from obseq.errors import InputError, SingularSystemError
from obseq.leastsquares import Blocks, LeastSquares, reliability, variance_components
from obseq.leastsquares.blocks import files, tasks, workers
from obseq.leastsquares.blocks.memory import bytes_of
from obseq.leastsquares.blocks.partition import Tree, entries_of
from obseq.leastsquares.blocks.solver import BlockSolver
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky


def network(solver="auto", n=12):
    """A square of points measured from plumb stations on every other one: directions, zeniths, distances."""
    rng = np.random.default_rng(3)
    system = LeastSquares(solver)
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) * 100.0
    true = np.column_stack([grid + rng.uniform(-20, 20, grid.shape), rng.uniform(0, 30, len(grid))])
    points = system.add_points([f"P{k}" for k in range(len(true))], true + rng.normal(0, 0.05, true.shape))
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
    return system, points, true


def held(system, points, true):
    """Three points with known coordinates."""
    corners = [0, 11, -1]
    system.add_prior(points[corners], true[corners], [0.01, 0.01, 0.02])


def on_a_datum(system, points, true):
    """Inner constraints of all points."""
    system.set_datum(points)


def constrained(system, points, true):
    """Linear rows, a length that holds, a difference of heights that holds, and robust weights."""
    held(system, points, true)
    system.add_linear([points[5:9]], [np.eye(3)[[0, 1, 2, 0]]], true[[5, 6, 7, 8], [0, 1, 2, 0]], 0.004)
    ends = true[[40, 55]]
    system.constrain(
        "Dist3D", {"p1": points[40:41], "p2": points[55:56]}, [[np.linalg.norm(ends[1] - ends[0])]]
    )
    up = np.array([[0.0, 0.0, 1.0]])
    system.constrain_linear([points[3:4], points[30:31]], [up, -up], [true[3, 2] - true[30, 2]])
    system.batches[0].loss = "huber"


def correlated(system, points, true):
    """A cluster of differences that are correlated with one another, over the whole network."""
    held(system, points, true)
    some = np.arange(0, 144, 13)
    sizes = len(some) - 1
    covariance = 1e-6 * (np.eye(3 * sizes) + 0.3)
    rows = system.add(
        "Dist3D",
        {"p1": points[some[:-1]], "p2": points[some[1:]]},
        np.linalg.norm(np.diff(true[some], axis=0), axis=1)[:, None],
        covariance=covariance[:sizes, :sizes],
    )
    assert rows.clusters is not None


KINDS = [held, on_a_datum, constrained, correlated]


def solved(solver, kind):
    """The system of a kind at its solution, its result, and its statistics."""
    system, points, true = network(solver)
    kind(system, points, true)
    result = system.solve(covariance=True, max_iterations=80)
    return system, points, result, reliability(system, result)


@pytest.mark.parametrize("parts", [2, 4])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_blocks_give_what_one_machine_gives(kind, parts):
    told = []
    whole, points, expected, quality = solved("auto", kind)
    with Blocks(parts=parts, tell=told.append) as blocks:
        system, _, found, same = solved(blocks, kind)
        assert "parts of at most" in told[0]
        assert found.converged
        assert found.redundancy == expected.redundancy
        assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-10)
        assert np.abs(system.unknowns.values - whole.unknowns.values).max() < 1e-9
        assert np.allclose(found.covariance(points), expected.covariance(points), rtol=1e-8, atol=1e-16)
        pairs = points[[0, 50]], points[[70, 143]]
        between = [one.covariance_between(*pairs) for one in (found, expected)]
        assert np.allclose(*between, rtol=1e-7, atol=1e-14)
        for mine, others in zip(system.batches, whole.batches, strict=True):
            assert np.allclose(found.residuals(mine), expected.residuals(others), rtol=0, atol=1e-10)
        for mine, others in zip(same.all, quality.all, strict=True):
            for name in ("redundancy", "w", "tau", "detectable", "external"):
                both = getattr(mine, name), getattr(others, name)
                assert np.allclose(*both, rtol=1e-8, atol=1e-9, equal_nan=True), name
    assert not blocks.run.folder.exists()


def test_eliminated_points_and_a_general_system():
    """Rotations, shared scalars and rigid frames; some points do not enter the matrix."""
    found = []
    with Blocks(parts=3) as blocks:
        for solver in ("auto", blocks):
            system, points, *_ = mixed_system()
            made = LeastSquares(solver)
            made.problem = system.problem
            made._analyses = type(made._analyses)(system.problem, solver, 1)
            made.set_datum(points)
            made.eliminate(made.add_points(["far"], [[1.0, 2.0, 3.0]]))
            made.add(
                "Dist3D", {"p1": points[:4], "p2": made.ids(["far"], "Point3")}, [3.0, 4.0, 5.0, 6.0], 0.1
            )
            result = made.solve(
                covariance=True, max_iterations=3, tolerance=-1.0, strategy="levenberg-marquardt"
            )
            found.append((made.unknowns.values.copy(), result.cofactors.variances()))
    assert np.allclose(found[1][0], found[0][0], rtol=1e-9, atol=1e-9)
    assert np.allclose(found[1][1], found[0][1], rtol=1e-7)


def test_variance_components_are_those_of_one_machine():
    factors = []
    with Blocks(parts=2) as blocks:
        for solver in ("auto", blocks):
            system, points, true = network(solver)
            held(system, points, true)
            factors.append(variance_components(system, method="redundancy").factors)
    assert np.allclose(factors[1], factors[0], rtol=1e-8)


def test_what_is_undetermined_is_told_as_by_one_machine():
    told = []
    with Blocks(parts=4) as blocks:
        for solver in ("auto", blocks):
            system, points, true = network(solver)
            system.add_prior(points[:1], true[:1], 0.01)
            with pytest.raises(SingularSystemError) as error:
                system.solve()
            told.append((error.value.defect, str(error.value).partition("Nothing fixes")[2]))
    assert "the rotation about z of 143 points" in told[0][1]
    assert told[0] == told[1]


def test_what_cannot_be_cut_is_solved_whole_and_says_so():
    told = []
    rng = np.random.default_rng(1)
    true = rng.uniform(0, 100, (30, 3))
    first, second = np.triu_indices(30, 1)
    with Blocks(parts=2, tell=told.append) as blocks:
        system = LeastSquares(blocks)
        points = system.add_points([f"P{k}" for k in range(30)], true)
        system.freeze(points[:3])
        lengths = np.linalg.norm(true[first] - true[second], axis=1)
        system.add("Dist3D", {"p1": points[first], "p2": points[second]}, lengths[:, None], 0.001)
        assert system.solve().converged
    assert told == ["blocks: 81 unknowns are solved whole, which cannot be cut"]


def test_each_entry_is_in_one_part_and_what_it_joins_is_there_or_above():
    system, points, true = network()
    held(system, points, true)
    pattern = system.equations().pattern
    tree = Tree(pattern)
    partition = tree.parts(tree.factor / 8)
    assert len(partition.parts) > 8
    entries = entries_of(pattern, partition)
    assert sorted(np.concatenate(entries)) == list(range(pattern.nnz))
    position = np.argsort(partition.unknowns)
    columns = pattern.columns()
    for part, mine in zip(partition.parts, entries, strict=True):
        here = {*part.own.tolist(), *part.outer.tolist()}
        assert set(position[columns[mine]]) | set(position[pattern.indices[mine]]) <= here
        for child in part.children:
            assert set(partition.parts[child].outer.tolist()) <= here


def test_the_inverse_below_follows_what_changes_above():
    system, points, true = network()
    held(system, points, true)
    equations = system.equations()
    pattern, values = equations.pattern, equations.assemble().values.copy()
    partition = Tree(pattern).parts(Tree(pattern).factor / 4)
    whole = SupernodalCholesky()
    whole.analyse(pattern)
    with Blocks(parts=4) as blocks:
        solver = BlockSolver(blocks.run)
        solver.analyse(pattern)
        for _ in range(2):
            solver.factor(values)
            whole.factor(values)
            assert np.allclose(solver.selected_inverse(), whole.selected_inverse(), rtol=1e-8)
            last = partition.unknowns[partition.parts[-1].own[-1]]
            values[pattern.diagonal[last]] *= 1.5  # the parts below keep their values


class Stopped(ThreadPoolExecutor):
    """Is stopped after some tasks."""

    def __init__(self, count):
        super().__init__(1)
        self.left, self.done = count, []

    def submit(self, function, /, *arguments, **_):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        self.done.append(arguments[1].__name__)
        return super().submit(function, *arguments)


def in_blocks(wrong=0.0, **settings):
    """The network, with lengths that are wrong by so much, solved in four parts."""
    with Blocks(parts=4, **settings) as blocks:
        system, points, true = network(blocks)
        held(system, points, true)
        if wrong:
            system.batches[-1].observations = system.batches[-1].observations[:, 0] + wrong
        return system.solve(covariance=True), system.unknowns.values.copy()


@pytest.mark.parametrize("tasks", [1, 5, 15, 30, 60, 90])
def test_a_run_that_was_stopped_is_taken_up_and_never_met_by_another(tmp_path, tasks):
    with pytest.raises(KeyboardInterrupt):
        in_blocks(0.01, client=Stopped(tasks), work=tmp_path)
    expected, values = in_blocks()
    told = []
    found, same = in_blocks(work=tmp_path, tell=told.append)  # corrected, in the same folder
    assert any("is left of a run that was stopped" in text for text in told)
    assert np.array_equal(same, values)
    again = Stopped(10_000)
    found, same = in_blocks(client=again, work=tmp_path, resume=True)  # takes up what the wrong run left
    assert np.array_equal(same, values)
    assert np.array_equal(found.cofactors.values, expected.cofactors.values)
    assert not list(tmp_path.iterdir())


def test_what_was_done_is_not_done_again(tmp_path):
    whole = Stopped(10_000)
    expected, values = in_blocks(client=whole)
    with pytest.raises(KeyboardInterrupt):
        in_blocks(client=Stopped(len(whole.done) - 1), work=tmp_path)
    rest = Stopped(10_000)
    found, same = in_blocks(client=rest, work=tmp_path, resume=True)
    assert np.array_equal(same, values)
    assert np.array_equal(found.cofactors.values, expected.cofactors.values)
    assert "reduce" not in rest.done  # the iterations are read
    assert len(rest.done) < len(whole.done) / 2


def test_two_runs_in_one_folder_do_not_meet(tmp_path):
    with Blocks(work=tmp_path) as first, Blocks(work=tmp_path, resume=True) as second:
        assert first.run.folder != second.run.folder


def test_a_full_disk_is_told(monkeypatch, tmp_path):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files.pickle, "dump", full)
    with pytest.raises(InputError, match="the disk is full; make room"):
        in_blocks(work=tmp_path)


def test_a_disk_with_too_little_room_is_told_before_the_work(monkeypatch, tmp_path):
    from obseq.leastsquares.blocks import blocks

    usage = blocks.shutil.disk_usage(tmp_path)._replace(free=1000)
    monkeypatch.setattr(blocks.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(InputError, match="and 0 MB are free: make room"):
        in_blocks(work=tmp_path)


def test_a_worker_of_another_version_is_told():
    with pytest.raises(
        InputError, match=r"a worker has obseq .*, this process obseq 0\.0: give them the same"
    ):
        tasks.task("obseq 0.0", tasks.prepare, ".", "part")


class Deserted:
    """A cluster whose workers leave when they are given something."""

    def __init__(self):
        self.workers = {"one": {}}

    def get_executor(self, **_):
        return self

    def scheduler_info(self, **_):
        return {"workers": self.workers}

    def submit(self, *_, **__):
        self.workers = {}
        return Future()

    def wait_for_workers(self, count, timeout):
        assert (count, timeout) == (1, workers.STARTING)
        if not self.workers:
            raise TimeoutError


class Lost(ThreadPoolExecutor):
    """A pool that loses the process of a task."""

    def submit(self, *_, **__):
        future = Future()
        future.set_exception(BrokenProcessPool("terminated abruptly"))
        return future


def test_a_lost_pool_is_told():
    with Lost(2) as pool, pytest.raises(InputError, match=r"a part was lost .*BrokenProcessPool.*--resume"):
        in_blocks(client=pool)


def test_a_cluster_without_workers_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(workers, "PATIENCE", 0.01)
    with pytest.raises(InputError, match="no worker is left; start others"):
        in_blocks(client=Deserted())


def test_memory_that_does_not_suffice_is_told():
    with pytest.raises(InputError, match=r"memory of 10 MB: this process takes .* beside the parts: give"):
        in_blocks(memory="10 MB")


@pytest.mark.parametrize(
    ("size", "count"),
    [("8GB", 8 * 10**9), ("1.5 gb", 15 * 10**8), ("500M", 5 * 10**8), (7, 7), ("3GiB", 3 * 10**9)],
)
def test_sizes_of_memory(size, count):
    assert bytes_of(size) == count


@pytest.mark.parametrize("size", ["much", "-1GB", "0", "8 XB", ""])
def test_sizes_that_are_none(size):
    with pytest.raises(InputError, match="is no size of memory"):
        bytes_of(size)


@pytest.mark.parametrize("settings", [{"resume": True}, {"client": 3.5}])
def test_settings_that_make_no_sense(settings):
    with pytest.raises(InputError, match=r"blocks: a Dask client|name the folder"):
        in_blocks(**settings)


@pytest.mark.slow  # a process that imports everything
def test_a_pool_of_processes_gives_the_same():
    expected, values = in_blocks()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found, same = in_blocks(client=pool)
    assert np.array_equal(same, values)
    assert np.array_equal(found.cofactors.values, expected.cofactors.values)
