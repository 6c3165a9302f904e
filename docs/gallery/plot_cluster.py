"""
A network for a cluster
=======================

A network is cut in parts. A local cluster of two processes eliminates them; the result is that of one
process. On machines of your own the same goes with the address of a scheduler and a shared folder.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

import obseq
from obseq.leastsquares import Blocks

places = np.random.default_rng(1).uniform(0.0, (1000.0, 1000.0, 200.0), (200, 3))
near = np.linalg.norm(places[:, None] - places, axis=2) < 200.0
first, second = np.nonzero(np.triu(near, 1))
lengths = np.linalg.norm(places[first] - places[second], axis=1) + 0.001 * np.sin(first)


def solved(solver):
    system = obseq.LeastSquares(solver)
    points = system.add_points([f"P{k}" for k in range(200)], places)
    system.add("Dist3D", {"p1": points[first], "p2": points[second]}, observations=lengths, sigmas=0.001)
    system.set_datum(points)
    solution = system.solve(covariance=True)
    return solution, solution.values(points), solution.precisions(points)


solution, whole, precisions = solved("auto")

# %%
# Two workers of this machine. With Dask installed (``pip install "obseq[dask]"``), ``client=2`` starts two
# processes, and ``client="tcp://head:8786"`` takes those of a scheduler, which read and write ``work``.

with ThreadPoolExecutor(2) as workers, Blocks(parts=4, client=workers, tell=print) as blocks:
    found, parts, same = solved(blocks)
print(f"sigma0 {solution.sigma0:.6f} at once, {found.sigma0:.6f} in parts")
print(f"coordinates differ by at most {np.abs(parts - whole).max():.1e} m, ", end="")
print(f"standard deviations by {np.abs(same / precisions - 1).max():.1e} of them")

# Next: :doc:`how it grows <../scaling>`.
