"""
A levelling network
===================

Five lines between four bench marks, one of which is known. Each loop must close.
"""

import matplotlib.pyplot as plt

from obseq.survey import network_from_tables

marks = {
    "name": ["A", "B", "C", "D"],
    "x": [0, 400, 800, 500],
    "y": [0, 100, 0, -300],
    "z": [50.0, 51.2, 49.9, 50.5],
    "sx": [0] * 4,
    "sy": [0] * 4,
    "sz": [0, None, None, None],
}
lines = {
    "type": ["DH"] * 5,
    "from": ["A", "B", "C", "D", "B"],
    "to": ["B", "C", "D", "A", "D"],
    "value": [1.204, -1.301, 0.602, -0.503, -0.699],
    "sigma": [0.001] * 5,
}
adjustment = network_from_tables(marks, lines, frame="Local").adjust()
for point in adjustment.record().points:
    print(f"{point.name}  {point.z:.4f} m  +- {1000 * (point.sz or 0):.2f} mm")

# %%
rows = adjustment.record().observations
plt.barh([f"{row.origin} - {row.target}" for row in rows], [1000 * row.residual for row in rows])
plt.xlabel("residual, mm")
plt.show()

# %%
# Next: :doc:`networks in Python <../examples>`.
