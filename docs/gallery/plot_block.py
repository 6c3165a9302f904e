"""
A block of images
=================

Four photographs of a wall with twenty targets, made up with a noise of 0.3 pixels. Eight targets are
known to a millimetre.
"""

import matplotlib.pyplot as plt
import numpy as np

from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses

targets = np.array([[x, y, 0.4 * ((x + y) % 2)] for x in range(5) for y in range(4)])
names = [f"T{k}" for k in range(20)]
truth = Camera("wide", 4000, 3000, focal=3000.0, distortion={"K1": -0.05})
poses = Poses.of(
    ["A", "B", "C", "D"],
    [[1, 1, 5], [3, 1, 5.5], [1, 2, 6], [3, 2, 5]],
    np.radians([[8, -8, 0], [9, 9, 90], [-7, -8, 180], [-9, 7, 0]]),
    "opk",
)
noise = np.random.default_rng(1)
seen = []
for image in poses:
    local = poses[image].to_local(targets)
    pixels = truth.project(local) + noise.normal(0.0, 0.3, (20, 2))
    seen += [(image, names[k], *pixels[k]) for k in np.flatnonzero(truth.sees(local))]
images, points, x, y = zip(*seen)

# %%
# The camera of the adjustment starts 50 pixels off and without distortion. Images have no poses.
known = [k for k in range(20) if k % 5 in (0, 3)]
surveyed = targets[known] + noise.normal(0.0, 0.001, (len(known), 3))
block = BundleAdjustment()
block.add_cameras(Camera("wide", 4000, 3000, focal=2950.0))
block.add_images(poses, "wide")
block.add_control_points(ControlPoints.of([names[k] for k in known], surveyed, 0.001))
block.add_measures(ImagePoints.of(images, points, np.column_stack([x, y]), 0.3))
block.freeze_parameters("K2|K3|p.|b.")
block.initialise()
solution = block.solve()
print(f"sigma0 {solution.sigma0:.3f}, focal length {solution.cameras['wide'].focal:.2f} pixels")

# %%
# Precisions of the targets, and the cameras seen from above:
sigmas = np.sqrt(np.diagonal(solution.point_covariances, axis1=1, axis2=2))
figure, axes = plt.subplots()
drawn = axes.scatter(*solution.coordinates[:, :2].T, c=1000 * sigmas[:, 2], s=60)
figure.colorbar(drawn, label="standard deviation of z, mm")
for image in solution.poses:
    centre = solution.poses[image].centre
    axes.plot(*centre[:2], "r^")
    axes.annotate(image, centre[:2], xytext=(5, 5), textcoords="offset points")
axes.set_aspect("equal")
plt.show()

# %%
# Next: :doc:`your first block of images <../first-block>`.
