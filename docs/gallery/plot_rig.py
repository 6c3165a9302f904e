"""
A rig of two cameras
====================

Two cameras on one bar take eight pairs of images. From poses that are known, ``initial_block`` finds the
place of the second camera in the frame of the first, and says how well the pairs agree. The pair of
exposure 5 was bumped by 4 mm.
"""

import matplotlib.pyplot as plt
import numpy as np

from obseq.geometry import exponential
from obseq.images import Poses, initial_block
from obseq.images.rigid import Exposures

noise = np.random.default_rng(4)
bar, turn = np.array([0.8, 0.0, 0.05]), exponential([0.0, 0.1, 0.0])
images, centres, rotations = [], [], []
for k in range(8):
    centre, rotation = np.array([2.0 * k, 0.0, 10.0]), exponential(noise.normal(0.0, 0.05, 3))
    bumped = np.array([0.004, 0.0, 0.0]) if k == 5 else 0.0
    images += [f"{k}_left", f"{k}_right"]
    centres += [centre, centre + rotation @ (bar + bumped) + noise.normal(0.0, 0.0003, 3)]
    rotations += [rotation, rotation @ turn @ exponential(noise.normal(0.0, 1e-5, 3))]
poses = Poses.of(images, centres, rotations)
exposures = Exposures.of(images, "(.*)_(left|right)", camera_group=2, exposure_group=1)
block, (pair,) = initial_block(poses, exposures)
print("place of the second camera", pair.mean.centre.round(4))
print("exposures that do not fit:", [pair.exposures[k] for k in np.flatnonzero(~pair.fits)])

# %%
away = 1000 * (pair.translations - np.median(pair.translations, axis=0))
plt.plot(range(8), away, "o-", label=["x", "y", "z"])
plt.xlabel("exposure")
plt.ylabel("from the median place, mm")
plt.legend()
plt.show()

# %%
# Next: :doc:`rigid blocks in a block of images <../first-block>`.
