"""Ten projects of Comp3D with everything that its grammar allows: points come out where they were put."""

import json
import math

import numpy as np
import pytest

from obseq import crs
from obseq.errors import InputError
from obseq.survey import Network

SETTINGS = {"root_COR_file": "p.cor", "root_OBS_file": "o.obs", "files_unit": 1, "local_center": [50, 50, 0]}
PLACES = {"A": (0, 0, 10), "B": (0, 100, 12), "C": (90, 95, 11), "P": (80, 40, 15), "Q": (30, 70, 13)}
GON = 200 / math.pi
KNOWN = "".join(
    f"1 {name} {x} {y} {z} 0.001 0.001 0.001\n" for name, (x, y, z) in PLACES.items() if name in "ABC"
)
FREE = "0 P 81 41 14\n0 Q 31 69 12\n"


def sight(origin, target):
    """Azimuth and zenith angle (gon), distance, of a sight in a flat world."""
    east, north, up = np.subtract(PLACES[target], PLACES[origin])
    flat = math.hypot(east, north)
    return math.atan2(east, north) * GON % 400, math.atan2(flat, up) * GON, math.hypot(flat, up)


def setup(origin, *targets, unit=1.0):
    """A round, zenith angles and distances."""
    lines = []
    for number, target in enumerate(targets):
        azimuth, zenith, distance = sight(origin, target)
        angles = f"{azimuth * unit:.7f}", f"{zenith * unit:.7f}"
        lines.append(f"{5 if number else 7} {origin} {target} {angles[0]} {0.001 * unit}")
        lines += [
            f"6 {origin} {target} {angles[1]} {0.001 * unit}",
            f"3 {origin} {target} {distance:.5f} 0.001",
        ]
    return "\n".join(lines) + "\n"


def turned(origin, turn, *targets, factor=1.0):
    """Components of the targets in a plumb frame, turned clockwise."""
    for name in targets:
        x, y, z = np.subtract(PLACES[name], PLACES[origin]) * factor
        yield name, x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z


def project(folder, cor=KNOWN + FREE, obs="", config=None, ends="\n", **files):
    (folder / "n.comp").write_text("data=\n" + json.dumps({"config": SETTINGS | (config or {})}))
    for name, text in {
        "p.cor": cor,
        "o.obs": obs,
        **{key.replace("_", "."): text for key, text in files.items()},
    }.items():
        (folder / name).write_bytes(text.replace("\n", ends).encode("latin-1"))
    return Network.read_project(folder / "n.comp", encoding="latin-1")


def check(adjusted, within=2e-3, names="PQ"):
    """The points are where they were put, and the observations fit: sigmas are not reached."""
    assert adjusted.converged
    assert np.sqrt(adjusted.solution.variance_factor or 0.0) < 1.0
    rows = dict(zip(adjusted.points.names, adjusted.points.crs_coordinates, strict=True))
    for name in names:
        np.testing.assert_allclose(rows[name], PLACES[name], rtol=0, atol=within, err_msg=name)


def test_odd_spacing_comments_and_line_ends(tmp_path):
    obs = setup("A", "B", "P", "Q") + setup("B", "A", "P", "Q")
    obs = (
        obs.replace(" ", " \t  ").replace("0.001\n", "0.001*not\xe9 glued\n") + "*\n  * comment *\nx\n\x1a\n"
    )
    cor = KNOWN.replace(" ", "\t") + FREE.replace("\n", "   *\xe0 l'est\n") + "\n\n"
    check(project(tmp_path, cor, obs, ends="\r\n").adjust())


def test_names_of_any_letters(tmp_path):
    names = {"P": "P\xe9,1;#\xb0", "Q": "-12.5e3"}
    texts = [KNOWN + FREE, setup("A", "B", "P", "Q") + setup("C", "A", "P", "Q")]
    for name, odd in names.items():
        texts = [text.replace(f" {name} ", f" {odd} ") for text in texts]
    adjusted = project(tmp_path, *texts).adjust()
    assert set(names.values()) <= set(adjusted.points.names)


def test_includes_five_levels_deep(tmp_path):
    folder = tmp_path
    for level in range(5):
        folder = folder / f"d{level}"
        folder.mkdir()
        below = f"@d{level + 1}\\in.obs what follows is ignored\n" if level < 4 else setup("A", "B", "P", "Q")
        (folder / "in.obs").write_text(below)
    (tmp_path / "more.cor").write_text(FREE)
    given = project(tmp_path, KNOWN + "@more.cor\n", "@d0/in.obs\n" + setup("B", "A", "P", "Q"))
    assert given.book.observations.file_indices.max() == 5
    check(given.adjust())


def test_everything_that_switches_off(tmp_path):
    cor = (
        KNOWN.replace("1 C 90 95 11 0.001 0.001 0.001", "1 C 90 95 11 0.001 0.001 -0.001")
        + FREE
        + "-1 X\n-1 Y z\n"
    )
    obs = setup("A", "B", "P", "Q") + setup("B", "A", "P", "Q", "C")
    obs += "-3 A P 999 0.001\n3 A P 999 -0.001\n-5 A P 300 0.001\n3 X P 5 0.1\n3 P Y 5 0.1\n7 X P 5 0.1\n"
    obs += "11 A @f.xyz V\n21 @e.eq\n18 Q @a.axe\n"
    lines = [
        f"{name} {x:.4f} {y:.4f} {z:.4f} -0.01 0.01 -0.01"
        for name, x, y, z in turned("A", 0.3, "B", "P", "Q")
    ]
    files = {"f_xyz": "\n".join([*lines, "X 1 2 3 0.01"]), "e_eq": "A P -0.01\nX A 0.1\nA B 0.1\n"}
    given = project(tmp_path, cor, obs, **files, a_axe="t 1 A -0.01 -0.01\nt 2 X 0.1 0.1\n")
    assert given.book.observations.n_inactive == 3 + 6 + 1 + 2
    assert any(
        "6 lines of observations name points that are to be ignored" in said for said in given.book.warnings
    )
    adjusted = given.adjust()
    check(adjusted)
    assert {"X", "Y"}.isdisjoint(adjusted.points.names)


def test_cartesian_frames(tmp_path):
    frames = {"f_xyz": [], "g_xyz": []}
    for name, x, y, z in turned("A", 0.7, "B", "C", "P", "Q"):
        frames["f_xyz"].append(f"{name} {x:.5f} {y:.5f} {z:.5f} 0.0002")
    for name, x, y, z in turned("C", -2.0, "A", "B", "P", "Q"):
        tail = {"A": "0.0002 1e-6", "B": "0.0002 0.0002 0.0002"}.get(name, "0.0002 0.0002 0.0002 1e-6 0.000")
        frames["g_xyz"].append(f"{name} {x:.5f} {y:.5f} {z:.5f} {tail}")
    texts = {name: "\n".join(lines) + "\n" for name, lines in frames.items()}
    given = project(tmp_path, obs="11 A @f.xyz V 10\n11 C @g.xyz N 10\n", **texts)
    assert given.book.observations.sigmas[0] == pytest.approx(0.002)
    assert given.book.observations.relative_sigmas.max() == pytest.approx(1e-6)  # K is for absolute sigmas
    adjusted = given.adjust()
    check(adjusted)
    assert adjusted.solution.n_unknowns == 15 + 1 + 3


def test_the_factor_of_a_polar_frame_is_for_its_absolute_sigmas(tmp_path):
    given = project(tmp_path, obs="12 A @f.pol V 10\n", f_pol="P 10 5 80 0.002 1e-7 0.003 2e-6\n")
    observed = given.book.observations
    assert observed.sigmas[:3] == pytest.approx([0.02 / GON, 0.02 / GON, 0.03])
    assert observed.relative_sigmas[:3] == pytest.approx([1e-7, 1e-7, 2e-6])


def test_polar_frames_of_directions_alone(tmp_path):
    texts = {}
    for name, origin, turn in (("f_pol", "A", 0.4), ("g_pol", "B", 1.1), ("h_pol", "C", 3.0)):
        others = [other for other in PLACES if other != origin]
        texts[name] = "".join(
            f"{target} {math.atan2(y, x) * GON:.7f} {math.atan2(z, math.hypot(x, y)) * GON:.7f} 0 1e-3 -1 0\n"
            for target, x, y, z in turned(origin, turn, *others)
        )
    check(project(tmp_path, obs="12 A @f.pol\n12 B @g.pol v\n12 C @h.pol -1 1\n", **texts).adjust())


def test_axes_that_share_their_origin(tmp_path):
    targets = {}
    for k in range(5):
        turn = 0.5 * k
        PLACES[f"h{k}"] = (40 + 5 * math.cos(turn), 50 + 5 * math.sin(turn), 14.0)
        PLACES[f"v{k}"] = (40.0, 50 + 4 * math.cos(turn), 14 + 4 * math.sin(turn))
        targets |= {f"h{k}": PLACES.pop(f"h{k}"), f"v{k}": PLACES.pop(f"v{k}")}
    cor = KNOWN + "".join(
        f"1 {n} {x:.6f} {y:.6f} {z:.6f} 0.001 0.001 0.001\n" for n, (x, y, z) in targets.items()
    )
    files = {
        f"{name}_axe": "".join(f"T {k} {name}{k} 0.001 0.001\n" for k in range(5)) + f"L {foot}\n"
        for name, foot in (("h", "h0"), ("v", "v0"))
    }
    given = project(tmp_path, cor, "18 O @h.axe\n18 O @v.axe\n", **files)
    adjusted = given.adjust()
    origin = adjusted.points.crs_coordinates[adjusted.points.names.index("O")]
    np.testing.assert_allclose(origin, (40, 50, 14), rtol=0, atol=2e-3)


def test_vectors_of_a_georeferenced_project(tmp_path):
    shift = np.array([700000.0, 6600000.0, 0.0])
    system = crs.parse("EPSG:2154")
    centre = {"use_proj": True, "proj_def": "EPSG:2154", "local_center": [700050, 6600050, 0]}
    station = system.to_geocentric(np.array([shift + PLACES["A"] + (0.0, 0.0, 1.5)]))[0]
    lines = ""
    for target, lift in (("B", 0.0), ("P", 1.7), ("Q", 0.0)):
        seen = system.to_geocentric(np.array([shift + PLACES[target] + (0.0, 0.0, lift)]))[0]
        lines += (
            f"{target} {' '.join(f'{v:.5f}' for v in seen - station)} 1e-6 2e-7 0 1e-6 1e-7 2e-6 {lift}\n"
        )
    lines += "C 1 2 3 -1e-6 0 0 1e-6 0 1e-6\n"
    cor = "".join(
        f"{'1' if name in 'ABC' else '0'} {name} {' '.join(str(v) for v in shift + xyz)}"
        + (" 0.001 0.001 0.001\n" if name in "ABC" else "\n")
        for name, xyz in PLACES.items()
    )
    given = project(tmp_path, cor, "19 A @b.bas 2 1.5\n", centre, b_bas=lines)
    assert given.book.clusters[0].covariance[0, 1] == pytest.approx(4 * 2e-7)
    adjusted = given.adjust()
    assert given.book.observations.n_inactive == 3
    rows = dict(zip(adjusted.points.names, adjusted.points.crs_coordinates, strict=True))
    for name in "PQ":
        np.testing.assert_allclose(rows[name] - shift, PLACES[name], rtol=0, atol=2e-3)


def test_covariances_equalities_and_centrings(tmp_path):
    cor = KNOWN + FREE + "4 L 50 50 20\n5 M 50 50 14 0 0 0.001\n0 E 31 70 13\n"
    obs = setup("A", "B", "P", "Q") + setup("B", "A", "P", "Q") + "21 @e.eq\n22 @d.eq\n"
    obs += "4 M L 6.0 0.001\n4 L P -5 0.002\n9 Q E 0 0.003 0.004\n4 Q E 0 0.001\n"
    names = [f"{point}_{axis}" for point in "AB" for axis in "xyz"]
    matrix = 1e-6 * (np.eye(6) + 0.4)
    rows = [",".join([name, *map(repr, map(float, row))]) for name, row in zip(names, matrix, strict=True)]
    covariance = "param," + ",".join(names) + "\n" + "\n".join(rows) + "\n"
    files = {"c_csv": covariance, "e_eq": "A B 0.002\nC Q 0.002\n", "d_eq": "P E 0.002\nP Q 0.002\n"}
    given = project(tmp_path, cor, obs, {"coord_cov_file": "c.csv"}, **files)
    assert given.points.covariance.matrix == pytest.approx(matrix)
    adjusted = given.adjust()
    check(adjusted)
    rows = dict(zip(adjusted.points.names, adjusted.points.crs_coordinates, strict=True))
    np.testing.assert_allclose(rows["L"][2], 20.0, atol=2e-3)
    np.testing.assert_allclose(rows["E"], PLACES["Q"], atol=3e-3)


def test_plane_points_and_inner_constraints(tmp_path):
    cor = "".join(
        f"{code} {name} {x} {y} 0 0.01 0.01 0\n"
        for code, name, (x, y, _) in (
            (7, "A", PLACES["A"]),
            (9, "B", PLACES["B"]),
            (6, "C", PLACES["C"]),
            (8, "P", PLACES["P"]),
        )
    )
    obs = ""
    for origin, target in ("AB", "AC", "AP", "BC", "BP", "CP"):
        obs += f"2 {origin} {target} {math.dist(PLACES[origin][:2], PLACES[target][:2]):.5f} 0.001\n"
    obs += f"8 A B {sight('A', 'B')[0]:.6f} 0.001\n6 A C 100 0.001\n"
    given = project(tmp_path, cor, obs, {"internal_constraints": True})
    assert given.datum.kind == "inner"
    assert any("zenith angles of points whose plan alone counts" in said for said in given.book.warnings)
    adjusted = given.adjust()
    rows = dict(zip(adjusted.points.names, adjusted.points.crs_coordinates, strict=True))
    np.testing.assert_allclose(rows["P"][:2], PLACES["P"][:2], rtol=0, atol=0.02)


def test_altitudes_in_degrees(tmp_path):
    cor = "5 A 0 0 100 0 0 0\n4 B 0 0 0\n5 C 0 0 120 0 0 0.001\n"
    config = {"use_ellips_height": False, "files_unit": 2}
    obs = "4 A B 12.5 0.001 1e-5 1.5 1.6\n4 B C 7.6 0.002\n4 B D 1.0 0.002\n-4 C A 5 0.001\n"
    adjusted = project(tmp_path, cor, obs, config).adjust()
    heights = dict(zip(adjusted.points.names, adjusted.points.crs_coordinates[:, 2], strict=True))
    assert heights["B"] == pytest.approx(112.4, abs=1e-3)
    assert heights["D"] == pytest.approx(113.4, abs=1e-3)


@pytest.mark.parametrize(
    ("cor", "obs", "files", "message"),
    [
        (
            "4 L 1 1 1\n",
            "3 A L 5 0.01\n",
            {},
            r"Dist A -> L \(.*o.obs:1\): of point L its height alone counts",
        ),
        ("6 L 1 1 1\n", "4 A L 5 0.01\n", {}, r"DH A -> L \(.*o.obs:1\): of point L its plan alone counts"),
        ("4 L 1 1 1\n", "11 A @f.x\n", {"f_x": "L 1 1 1 1\n"}, r"f.x:1\): of point L its height alone"),
        ("", "19 A @b.bas\n", {"b_bas": "P 1 2 3 1 0 0 1 0 1\n"}, r"o.obs:1: geocentric vectors \(code 19\)"),
        ("", "18 O @a.axe\n", {"a_axe": "t 1 A 1 1\nt 2 A 1 1\n"}, "a.axe:2: point A is given twice"),
        (
            "",
            "18 O @a.axe\n",
            {"a_axe": "t 1 A 1 1\nt 1 B 1 1\n"},
            "a.axe:2: position 1 of target t is given",
        ),
        ("1 X 1 1 1\n", "3 A P 5 1\n", {}, "p.cor:6: a known point without sigma"),
        ("10 X 1 1 1\n", "3 A P 5 1\n", {}, "p.cor:6: unknown flag '10'"),
        ("", "3 A P 5 0.1 0 1.5\n", {}, "o.obs:1: 2 numbers after the sigma"),
        ("", "3 A P 5 0.1 -1e-6\n", {}, "o.obs:1: a relative sigma of -1e-06"),
        ("", "11 A @f.x V 1 2\n", {"f_x": "P 1 1 1 1\n"}, "o.obs:1: after the file of a sub-frame"),
        ("", "12 A @f.x\n", {"f_x": "P 1 1 0 1 1 0\n"}, "f.x:1: the distance 0 is not positive"),
        ("", "12 A @f.x\n", {"f_x": "A 1 1 5 1 1 0\n"}, "f.x:1: the target is the origin"),
        ("", "22 @e.eq\n", {"e_eq": "@more.eq\n"}, "e.eq:1: a file of this kind includes no other"),
    ],
)
def test_what_the_grammar_does_not_allow(tmp_path, cor, obs, files, message):
    with pytest.raises(InputError, match=message):
        project(tmp_path, KNOWN + FREE + cor, obs, **files).adjust()
