"""Errors in a traverse, where hardly anything is redundant: the sight is found, or those it may be."""

import numpy as np
import pytest

from obseq.survey import Network
from obseq.survey.screening.findings import Cause

PLACES = {"A": (1000.0, 5000.0, 100.0), "B": (1180.0, 5040.0, 104.0), "T1": (1060.0, 5090.0, 102.0)}
PLACES |= {"T2": (1130.0, 5150.0, 107.0), "T3": (1210.0, 5170.0, 103.0)}
PLACES |= {"C": (1300.0, 5120.0, 101.0), "D": (1330.0, 5230.0, 105.0)}
WAY = ("B", "A", "T1", "T2", "T3", "C", "D")
HEADER = [".UNITS METERS DMS", ".ORDER EN AtFromTo", ".3D"]
HEADER += [f"C {name} {' '.join(map(str, PLACES[name]))} ! ! !" for name in "ABCD"]


def sexagesimal(degrees):
    minutes, seconds = divmod(degrees % 360.0 * 3600.0, 60.0)
    return f"{int(minutes // 60)}-{int(minutes % 60):02d}-{seconds:06.3f}"


def sight(random, back, here, there):
    """One line of a traverse: angle from the point before, slope distance, zenith angle."""
    to_there, to_back = (np.subtract(PLACES[end], PLACES[here]) for end in (there, back))
    turn = np.degrees(np.arctan2(*to_there[:2]) - np.arctan2(*to_back[:2])) + random.normal(0.0, 2.0 / 3600)
    flat = np.hypot(*to_there[:2])
    length = np.hypot(flat, to_there[2]) + random.normal(0.0, 0.002)
    zenith = np.degrees(np.arctan2(flat, to_there[2])) + random.normal(0.0, 3.0 / 3600)
    angle, height = sexagesimal(turn), sexagesimal(zenith)
    return f"M {here}-{back}-{there} {angle} {length:.4f} {height} 2.0 0.003 4.0 1.55/1.55".split()


def errors_of(folder, spoil, header=HEADER):
    random = np.random.default_rng(3)
    lines = [sight(random, *three) for three in zip(WAY, WAY[1:], WAY[2:], strict=False)]
    spoil({line[1].split("-")[0]: line for line in lines})
    texts = [*header, *(" ".join(line) for line in lines)]
    (folder / "t.dat").write_text("\n".join(texts) + "\n", encoding="utf-8")
    return Network.read_project(folder / "t.dat").gross_errors()


def test_an_honest_traverse_raises_no_alarm(tmp_path):
    assert errors_of(tmp_path, lambda lines: None) == ()


def test_one_distance_in_feet_is_found_though_others_contradict(tmp_path):
    def spoil(lines):
        lines["T2"][3] = f"{float(lines['T2'][3]) / 0.3048:.4f}"

    (error,) = errors_of(tmp_path, spoil)
    assert error.what.startswith("Dist T2 -> T3") and error.cause is Cause.UNITS and "feet" in error.text


@pytest.mark.parametrize(
    ("written", "slip", "is_alone"),
    [("5.15", "m fits", False), ("15.5", "decimal point", True)],
)
def test_a_wrong_height_of_instrument_is_among_those_that_fit(tmp_path, written, slip, is_alone):
    """Other heights would do as well, but those that would have to be 14 m less than 1.55 m, or more."""

    def spoil(lines):
        lines["T2"][-1] = f"{written}/1.55"

    (error,) = errors_of(tmp_path, spoil)
    said = f"{error.what}: {error.text}"
    assert error.is_one and error.cause is Cause.HEIGHT
    assert said.count("nothing tells these apart") == (0 if is_alone else 1)
    (true,) = [
        one for one in said.split("; or ") if "height of the instrument of 2 observations from T2" in one
    ]
    assert f"{float(written):.4f} m is written, 1.5" in true and slip in true
    assert is_alone == ("; or " not in said)


def test_northings_read_as_eastings_may_be_angles_that_are_turned(tmp_path):
    header = [line.replace("ORDER EN", "ORDER NE") for line in HEADER]
    (error,) = errors_of(tmp_path, lambda lines: None, header)
    assert "easting and northing of all points look swapped" in error.text and "anticlockwise" in error.text


def test_heights_in_metres_where_feet_are_meant(tmp_path):
    header = [line.replace(".UNITS METERS", ".UNITS FeetInt") for line in HEADER]
    for k, line in enumerate(header):
        words = line.split()
        if words[0] == "C":
            flat = [f"{float(value) / 0.3048:.4f}" for value in words[2:4]]
            header[k] = " ".join([*words[:2], *flat, *words[4:]])

    def in_feet(lines):
        for line in lines.values():
            line[3], line[6] = (f"{float(line[k]) / 0.3048:.4f}" for k in (3, 6))
            line[-1] = "5.0853/5.0853"

    (error,) = errors_of(tmp_path, in_feet, header)
    assert error.cause is Cause.UNITS and "heights of all points look like metres read as feet" in error.text


TABLE = "type,from,to,value,sigma,unit,set"


def site(folder, change):
    """Directions, zenith angles and distances from three points to all others, in tables."""
    random, rows = np.random.default_rng(4), [TABLE.split(",")]
    for here in ("A", "C", "T2"):
        zero = random.uniform(0.0, 400.0)
        for there in PLACES:
            if there != here:
                gap = np.subtract(PLACES[there], PLACES[here])
                flat = float(np.hypot(*gap[:2]))
                hz = (np.arctan2(*gap[:2]) * 200.0 / np.pi - zero + random.normal(0.0, 6e-4)) % 400.0
                zenith = np.arctan2(flat, gap[2]) * 200.0 / np.pi + random.normal(0.0, 8e-4)
                length = float(np.hypot(flat, gap[2])) + random.normal(0.0, 0.002)
                rows.append(["Hz", here, there, f"{hz:.5f}", "0.0006", "gon", "1"])
                rows.append(["Zen", here, there, f"{zenith:.5f}", "0.0008", "gon", "1"])
                rows.append(["Dist", here, there, f"{length:.4f}", "0.002", "m", "1"])
    for row in rows[1:]:
        change(row)
    points = ["name,x,y,z,sx,sy,sz"]
    points += [f"{n},{','.join(map(str, PLACES[n]))},0.002,0.002,0.002" for n in "ABCD"]
    (folder / "o.csv").write_text("\n".join(map(",".join, rows)), encoding="utf-8")
    (folder / "p.csv").write_text("\n".join(points), encoding="utf-8")
    return Network.read_project([folder / "p.csv", folder / "o.csv"]).gross_errors()


def test_horizontal_distances_taken_for_slope_distances(tmp_path):
    def flatten(row):
        if row[0] == "Dist":
            row[3] = f"{np.hypot(*np.subtract(PLACES[row[2]], PLACES[row[1]])[:2]):.4f}"

    (error,) = site(tmp_path, flatten)
    assert error.cause is Cause.HORIZONTAL and error.what.startswith("all 18 Dist observations")


@pytest.mark.parametrize("kinds", [("Hz", "Zen")])
def test_gon_in_a_set_up_that_says_degrees(tmp_path, kinds):
    def mark(row):
        if row[0] in kinds and row[1] == "C":
            row[5] = "deg"

    (error,) = site(tmp_path, mark)
    assert error.cause is Cause.UNITS and "gon, and were read as degrees" in error.text
    assert error.what.startswith("all 12 angles from C")
