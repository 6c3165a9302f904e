"""
A network in parts
==================

A network is cut in parts that are eliminated for themselves, and joined. The result is that of one
machine.
"""

import numpy as np

import obseq
from obseq.leastsquares import solve_in_blocks

places = np.random.default_rng(1).uniform(0.0, 100.0, (40, 3))
first, second = np.triu_indices(40, 1)
lengths = np.linalg.norm(places[first] - places[second], axis=1) + 0.001 * np.sin(first)


def system():
    one = obseq.LeastSquares()
    points = one.add_points([f"P{k}" for k in range(40)], places)
    one.freeze(points[:3])
    one.add("Dist3D", {"p1": points[first], "p2": points[second]}, observations=lengths, sigmas=0.001)
    return one, points


whole, points = system()
solution = whole.solve()
parts, same = system()
found = solve_in_blocks(parts, depth=2)
print(f"sigma0 {solution.sigma0:.6f} at once, {found.sigma0:.6f} in four parts")
print(f"largest difference {np.abs(solution.values(points) - parts.values(same)).max():.1e} m")

# %%
# Next: :doc:`how it grows <../scaling>`.
