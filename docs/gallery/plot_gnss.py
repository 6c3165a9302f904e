"""
GNSS vectors and a tape
=======================

Two vectors from a base, and a tape between their ends. The tape is ten times as good as the vectors along
it, and not across.
"""

from obseq.survey import Quality, network_from_tables

points = {"name": ["BASE", "R1", "R2"]}
points |= {axis: [0, None, None] for axis in "xyz"} | {f"s{axis}": [0.001, None, None] for axis in "xyz"}
rows = [
    ("DX", "BASE", "R1", 1000.004, 0.005),
    ("DY", "BASE", "R1", 199.997, 0.005),
    ("DZ", "BASE", "R1", 5.003, 0.010),
    ("DX", "BASE", "R2", 1040.002, 0.005),
    ("DY", "BASE", "R2", 229.999, 0.005),
    ("DZ", "BASE", "R2", 4.995, 0.010),
    ("Dist", "R1", "R2", 50.0005, 0.001),
]
table = dict(zip(("type", "from", "to", "value", "sigma"), map(list, zip(*rows))))
table["orientation"] = ["FIX"] * 6 + [None]
adjustment = network_from_tables(points, table, frame="Local").adjust(quality=Quality(relative=True))
pair = next(pair for pair in adjustment.record().relative if {pair.first, pair.second} == {"R1", "R2"})
print(f"R1 - R2: {pair.distance:.4f} m +- {1000 * pair.precision:.1f} mm")

# %%
adjustment.plot()

# %%
# Next: :doc:`vectors of receivers in files <../survey-files>`.
