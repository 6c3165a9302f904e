"""Systems to be interrupted, and signals that arrive at any moment."""

import os
import signal
import threading
import time

import numpy as np

from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares

PENDING = 0.5
"""Seconds in which a signal that was sent arrives."""


def interrupted(work, delay):
    """Does some work, and says whether a signal sent by another thread after a delay came before its end."""
    timer = threading.Timer(delay, os.kill, (os.getpid(), signal.SIGINT))
    done = False
    try:
        timer.start()
        work()
        done = True
        timer.join()
        time.sleep(PENDING)
    except KeyboardInterrupt:
        timer.join()
    return not done


def bundle(solver="auto", threads=1, seed=0, n=60):
    """Stations with rotations that see points, which are eliminated: directions, distances, priors."""
    rng = np.random.default_rng(seed)
    system = LeastSquares(solver, threads)
    centres = np.array([[0, 0, 0], [100, 0, 3], [100, 100, -2], [0, 100, 1], [50, -40, 8.0]])
    targets = rng.uniform([20, 20, -10], [80, 80, 30], (n, 3))
    stations = system.add_points(list("ABCDE"), centres + rng.normal(0, 0.2, centres.shape))
    turns = system.add_rotations(list("ABCDE"), exponential(rng.normal(0, 0.02, (5, 3))))
    points = system.add_points([f"p{k}" for k in range(n)], targets + rng.normal(0, 0.2, targets.shape))
    station, point = (k.ravel() for k in np.meshgrid(np.arange(5), np.arange(n), indexing="ij"))
    vectors = targets[point] - centres[station] + rng.normal(0, 0.01, (5 * n, 3))
    frame = {"frame": turns[station], "p1": stations[station], "p2": points[point]}
    system.add("TopoSubFrame", frame, vectors, 0.01)
    lengths = np.linalg.norm(targets[point] - centres[station], axis=1) + rng.normal(0, 0.005, 5 * n)
    system.add("Dist3D", {"p1": stations[station], "p2": points[point]}, lengths, 0.005)
    system.add_prior(stations[:3], centres[:3], 0.01)
    system.eliminate(points)
    return system


def free_network(seed=1, n=12):
    """Distances alone, on a datum of all points."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(0, 100, (n, 3))
    system = LeastSquares("supernodal")
    ids = system.add_points([f"p{k}" for k in range(n)], true + rng.normal(0, 0.3, true.shape))
    i, j = np.triu_indices(n, 1)
    lengths = np.linalg.norm(true[i] - true[j], axis=1) + rng.normal(0, 0.01, len(i))
    system.add("Dist3D", {"p1": ids[i], "p2": ids[j]}, lengths, 0.01)
    system.set_datum(ids)
    return system


def found(system):
    """Everything that a solution with covariances says, as one vector."""
    result = system.solve(covariance=True)
    scalars = [result.sigma0, float(result.redundancy), float(len(result.iterations)), result.cost]
    return np.concatenate([result.state.values, result.state.context, result.cofactors.variances(), scalars])
