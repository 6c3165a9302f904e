"""Precisions that textbooks print, and the reliability of their levelling networks, from gama-local files."""

import json
import math
import xml.etree.ElementTree as ElementTree
from functools import cache

import numpy as np
import pytest
from outside import OutsideData

from obseq.survey import Network

AXES = {"gama-textbook-1d": "z", "gama-textbook-2d": "xy", "gama-textbook-3d": "xyz"}
PRINTED = {"z": 1e-3, "xy": 1e-2, "xyz": 1e-2}
"""Unit of the printed precisions, metres: millimetres of levelling, centimetres elsewhere."""
TAG = "{http://www.gnu.org/software/gama/gama-local}"


def networks(folders=tuple(AXES), key="file"):
    """(folder, name) of networks of textbooks, of some folders, of which something is expected."""
    for folder in OutsideData().sets(folders):
        found = json.loads((folder / "expected.json").read_text())["networks"]
        yield from ((folder.name, name) for name in found if key in found[name])


PUBLISHED = list(networks(key="published_krumm"))
PLANE = list(networks(["gama-textbook-2d"], "published_krumm"))
LEVELLING = list(networks(["gama-textbook-1d"]))


@cache
def adjusted(path):
    return Network.read_project(path).adjust()


def printed(path):
    """Point -> numbers of a line: value, correction, precision by axis, then the precision of the point."""
    lines = path.read_text(encoding="utf-8").replace("\N{MINUS SIGN}", "-").splitlines()
    rows = [line.split("#")[0].split() for line in lines]
    return {row[0]: [float(text) for text in row[1:]] for row in rows if row}


@pytest.mark.parametrize(("folder", "name"), PUBLISHED)
def test_coordinates_and_precisions_are_those_printed(shared_data, folder, name):
    axes, path = AXES[folder], shared_data / folder / f"{name}.gkf"
    points = adjusted(path).points
    columns = ["xyz".index(axis) for axis in axes]
    for point, numbers in printed(path.with_suffix(".adj")).items():
        row = points.names.index(point)
        count = 3 * len(axes)
        assert points.crs_coordinates[row, columns] == pytest.approx(numbers[0:count:3], abs=5.1e-5)
        precisions = points.crs_precisions[row, columns] / PRINTED[axes]
        half = {"z": 5.1e-3, "xy": 5.1e-4, "xyz": 5.1e-4}[axes]  # of the last printed digit
        assert precisions == pytest.approx(numbers[2:count:3], abs=half)
        if len(axes) > 1:
            assert math.hypot(*precisions) == pytest.approx(numbers[-1], abs=2 * half)


@pytest.mark.parametrize(("folder", "name"), PLANE)
def test_ellipses_hold_the_precision_of_the_point_that_is_printed(shared_data, folder, name):
    path = shared_data / folder / f"{name}.gkf"
    record = adjusted(path).record()
    ellipses = {point.name: point.ellipse for point in record.points}
    for point, numbers in printed(path.with_suffix(".adj")).items():
        both = math.hypot(ellipses[point].semi_major, ellipses[point].semi_minor)
        assert 100 * both == pytest.approx(numbers[-1], abs=1.1e-3)


@pytest.mark.parametrize(("folder", "name"), PUBLISHED)
def test_redundancies_share_out_the_degrees_of_freedom(shared_data, folder, name):
    wanted = json.loads((shared_data / folder / "expected.json").read_text())["networks"][name]
    rows = adjusted(shared_data / folder / wanted["file"]).record().observations
    assert sum(row.redundancy for row in rows) == pytest.approx(wanted["dof"], abs=1e-9)
    squares = sum((row.residual / row.sigma) ** 2 for row in rows)
    assert squares == pytest.approx(wanted["dof"] * wanted["sigma0"] ** 2, rel=2e-6)


def levelling(path):
    """Design (n, u), observed minus known (n,) and sigmas (n,) of a levelling network, from its file."""
    tree = ElementTree.parse(path)
    points = {point.get("id"): point for point in tree.iter(f"{TAG}point")}
    free = [name for name, point in points.items() if not point.get("fix")]
    rises = [rise for rise in tree.iter(f"{TAG}dh") if rise.get("val")]
    parameters = next(tree.iter(f"{TAG}parameters"), ElementTree.Element("parameters"))
    apriori = float(parameters.get("sigma-apr", 10))
    design, values, sigmas = np.zeros((len(rises), len(free))), np.zeros(len(rises)), np.zeros(len(rises))
    for row, rise in enumerate(rises):
        values[row] = float(rise.get("val"))
        sigmas[row] = float(rise.get("stdev") or apriori * math.sqrt(float(rise.get("dist") or 0))) / 1e3
        for end, sign in (("from", -1.0), ("to", 1.0)):
            if rise.get(end) in free:
                design[row, free.index(rise.get(end))] = sign
            else:
                values[row] -= sign * float(points[rise.get(end)].get("z"))
    return design, values, sigmas


@pytest.mark.parametrize(("folder", "name"), LEVELLING)
def test_reliability_of_levelling_is_that_of_its_dense_projector(shared_data, folder, name):
    path = shared_data / folder / f"{name}.gkf"
    design, values, sigmas = levelling(path)
    basis, _ = np.linalg.qr(design / sigmas[:, None])
    projector = np.eye(len(values)) - basis @ basis.T
    residuals = -projector @ (values / sigmas)
    redundancies = np.diag(projector)
    rows = adjusted(path).record().observations
    assert [row.redundancy for row in rows] == pytest.approx(redundancies, abs=5e-8)
    for row, residual, redundancy in zip(rows, residuals, redundancies, strict=True):
        if redundancy < 1e-6:  # a spur: nothing controls it
            assert row.standardised_residual is None
        else:
            assert row.standardised_residual == pytest.approx(residual / math.sqrt(redundancy), abs=5e-8)
