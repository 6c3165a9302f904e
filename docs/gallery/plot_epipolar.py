"""
Do two orientations agree?
==========================

A hundred points of a scene are seen by two cameras. The second orientation is turned by a hundredth of a
degree about its viewing axis. The epipolar residuals show it: they grow from the middle of the image.
"""

import matplotlib.pyplot as plt
import numpy as np

from obseq.images.epipolar import Pinhole, epipolar_residuals


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


middle = np.array([3000.0, 2000.0])
left = Pinhole(np.zeros(3), np.eye(3), 5000.0, middle)
right = Pinhole(np.array([100.0, 0.0, 0.0]), np.eye(3), 5000.0, middle)
scene = np.random.default_rng(2).uniform([-400, -300, 900], [500, 300, 1100], (100, 3))
first, second = left.project(scene), right.project(scene)
wrong = Pinhole(np.array([100.0, 0.0, 0.0]), turned(np.radians(0.01)), 5000.0, middle)
found = epipolar_residuals(left, first, wrong, second)
print(f"rms {np.sqrt(np.mean(found.values**2)):.3f} pixels")

# %%
drawn = plt.scatter(*first.T, c=found.values, cmap="RdBu")
plt.colorbar(drawn, label="pixels")
plt.gca().invert_yaxis()
plt.gca().set_aspect("equal")
plt.show()

# %%
# Next: :doc:`the epipolar residual <../epipolar>`.
