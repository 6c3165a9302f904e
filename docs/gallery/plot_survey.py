"""
A survey network
================

Directions, zenith angles and distances between two known points and two new ones: the packaged demo.
"""

from importlib.resources import files

from obseq.survey import Network

folder = files("obseq.survey") / "data"
network = Network.read(f"{folder}/demo.obs", f"{folder}/demo.cor", points_crs="IGNF:LAMB93")
adjustment = network.adjust()
print(f"sigma0 {adjustment.sigma0:.3f}, redundancy {adjustment.record().redundancy}")

# %%
# Ellipses are enlarged. A point that is known is a triangle.
adjustment.plot()

# %%
# What each observation is worth:
rows = adjustment.record().observations
for row in sorted(rows, key=lambda row: row.redundancy)[:5]:
    print(f"{row.type:5} {row.origin} -> {row.target}  redundancy {row.redundancy:.2f}")

# %%
# Next: :doc:`a first network in ten minutes <../first-network>`.
