"""
Aerial images on a map
======================

Two shots 1400 m above flat ground, in Lambert 93. Where are points that both see, and how well?
"""

import matplotlib.pyplot as plt
import numpy as np

from obseq.images.aerial import FrameCamera, HeightType, MapSystem, Shots, Worksite, intersect_pairs

shots = Shots.from_angles(
    ["A", "B"],
    [[700000.0, 6600000.0, 1500.0], [700400.0, 6600000.0, 1500.0]],
    np.zeros((2, 3)),
    ["camera", "camera"],
    height_type=HeightType.HEIGHT,
)
camera = FrameCamera("camera", (500.0, 400.0), 1000.0, (1000, 800))
site = Worksite(shots, {"camera": camera}, MapSystem("EPSG:2154"))

left = np.array([[x, y] for x in range(300, 1000, 100) for y in range(100, 800, 150)], float)
pixels = np.stack([left, left - [286.0, 0.0]], axis=1)
pairs = np.tile([[0, 1]], (len(left), 1))
found = intersect_pairs(site, pairs, pixels, sigma=0.3)
sigmas = np.sqrt(np.diagonal(found.covariances, axis1=1, axis2=2))
print(f"heights {found.points[:, 2].mean():.1f} m +- {sigmas[:, 2].mean():.2f} m")

# %%
# Precision of the height over the ground:
drawn = plt.scatter(*found.points[:, :2].T, c=sigmas[:, 2])
plt.colorbar(drawn, label="standard deviation of the height, m")
plt.plot([700000, 700400], [6600000, 6600000], "r^")
plt.gca().set_aspect("equal")
plt.ticklabel_format(useOffset=False)
plt.xticks(rotation=30)
plt.show()

# %%
# Next: :doc:`aerial images <../aerial>`.
