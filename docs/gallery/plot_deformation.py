"""
What has moved between two epochs
=================================

A strip of six points is observed twice. Point ``C`` moves by 6 mm in between. All six are given as points
that should have stayed, and the one that has not is named.
"""

import matplotlib.pyplot as plt
import numpy as np

from obseq.survey import Datum, compare, network_from_tables

places = {"A": (0, 0), "B": (80, 90), "C": (160, 0), "D": (240, 90), "E": (320, 0), "F": (400, 90)}
sights = [(a, b) for a in places for b in places if a != b]


def epoch(seed, moved):
    noise = np.random.default_rng(seed)
    true = {name: np.array(place, float) for name, place in places.items()}
    true["C"] = true["C"] + moved
    table = {"type": [], "from": [], "to": [], "value": [], "sigma": []}
    for start, end in sights:
        east, north = true[end] - true[start]
        for kind, value, sigma in (
            ("Dist", np.hypot(east, north), 0.001),
            ("Hz", np.arctan2(east, north) * 200 / np.pi, 0.0005),
            ("DH", 0.0, 0.001),
        ):
            row = (kind, start, end, value + sigma * noise.normal(), sigma)
            for name, item in zip(table, row):
                table[name].append(item)
    points = {"name": list(places), "z": [0.0] * 6}
    points |= {"x": [place[0] for place in places.values()], "y": [place[1] for place in places.values()]}
    points |= {f"s{axis}": [None] * 6 for axis in "xyz"}
    return network_from_tables(points, table, frame="Local", angles="gon").adjust(datum=Datum("inner"))


found = compare(epoch(1, (0, 0)), epoch(2, (0.004, 0.0045)), reference=list(places))
print("moved:", *found.record().moved)

# %%
record = found.record()
figure, axes = plt.subplots()
for point in record.displacements:
    x, y = places[point.point]
    axes.plot(x, y, "k.")
    axes.annotate(point.point, (x, y), xytext=(4, 4), textcoords="offset points")
    axes.arrow(x, y, 5000 * point.east, 5000 * point.north, color="crimson", head_width=6)
axes.set_aspect("equal")
axes.set_title("displacements, 5000 times enlarged")
plt.show()

# %%
# Next: :doc:`plan a network, and compare two epochs <../planning>`.
