"""Comp3D projects, against the numbers of Comp3D and those of its equations on the ellipsoid."""

import json
import re
import shutil

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError, SingularSystemError
from obseq.survey import Datum, Network

pytestmark = pytest.mark.usefixtures("unsearched")

CASES = {
    # sigma0 on the ellipsoid with the constraints in the system of the points, active observations, unknowns,
    # largest difference to the coordinates of Comp3D in plan and height (it computes on a sphere).
    "axe": (0.591708, 42, 38, 2e-6, 2e-6),  # Comp3D: two gauges, each an observation and an unknown
    "bascule": (462.24137, 144, 98, 2e-6, 2e-6),  # Comp3D tilts verticals: 463.107
    "baselines": (1.0207827, 12, 9, 1e-7, 1e-7),
    "big-1km": (None, 48, 22, 2e-5, 2e-4),
    "big-10km": (None, 48, 22, 5e-3, 2e-2),
    "centering": (700.140058, 8, 6, 1e-7, 1e-8),
    "corcov": (0.19999, 7, 6, 1e-7, 1e-8),
    "eq-constr": (0.0, 21, 20, 1e-6, 1e-8),
    "figure": (0.896176, 536, 262, 1e-6, 1e-6),
    "fixed-points2": (99.503719, 42, 36, 1e-7, 1e-7),
    "geo-mini-basc": (7.304264, 31, 21, 1e-7, 1e-8),
    "geo-mini-l93": (11.545597, 19, 15, 1e-7, 1e-8),
    "minimal": (0.70710678, 9, 8, 1e-7, 1e-7),
    "modane": (1.0200889, 243, 132, 1e-3, 1e-5),
    "polygone-k06": (1.1631611, 363, 178, 1e-6, 1e-7),
    "simple2d": (4.4632184, 9, 8, 1e-8, 1e-8),
    "weights": (1.07309677, 18, 12, 1e-8, 1e-8),
}


def project(shared_data, name):
    return Network.read_project(shared_data / f"comp3d-{name}" / "project.comp", encoding="latin-1")


@pytest.mark.parametrize("name", CASES)
def test_numbers_of_comp3d(shared_data, name):
    sigma0, active, unknowns, plan, height = CASES[name]
    adjusted = project(shared_data, name).adjust()
    solution = adjusted.solution
    assert adjusted.converged
    assert (solution.n_observations + solution.n_constraints, solution.n_unknowns) == (active, unknowns)
    if sigma0 is not None:
        assert np.sqrt(solution.variance_factor) == pytest.approx(sigma0, rel=2e-6, abs=1e-5)
    expected = json.loads((shared_data / f"comp3d-{name}" / "expected.json").read_text())["points"]
    compared = 0
    for point, xyz in zip(adjusted.points.names, adjusted.points.coordinates, strict=True):
        given = expected.get(point, {}).get("cartesian")
        if given is not None:
            gap = np.abs(xyz - given)
            assert not (gap[:2] >= plan).any(), point  # nothing but levelling: its plan is no number
            assert gap[2] < height, point
            compared += 1
    assert compared > 1


def test_more_is_placed_than_comp3d_places(shared_data):
    # Comp3D gives up on the points 3 and c1 of init-cap, and drops their twelve observations.
    adjusted = project(shared_data, "init-cap").adjust()
    assert {"3", "c1"} <= set(adjusted.points.names)
    assert adjusted.solution.n_observations == 40
    assert not adjusted.left_out
    assert np.sqrt(adjusted.solution.variance_factor) == pytest.approx(0.09466, abs=1e-4)


def test_what_comp3d_places_is_adjusted_as_there(shared_data, tmp_path):
    folder = shared_data / "comp3d-init-cap"
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    config = json.loads((tmp_path / "project.comp").read_text(encoding="latin-1").partition("=")[2])["config"]
    with (tmp_path / config["root_COR_file"]).open("a", encoding="latin-1") as points:
        points.write("\n-1 3\n-1 c1\n")
    adjusted = Network.read_project(tmp_path / "project.comp", encoding="latin-1").adjust()
    solution = adjusted.solution
    assert (solution.n_observations + solution.n_constraints, solution.n_unknowns) == (40, 30)
    assert np.sqrt(solution.variance_factor) == pytest.approx(0.1143987, rel=2e-3)  # comp3d.md 4.3


def test_heights_are_kept_through_a_change_of_datum(shared_data):
    # The coordinates of Comp3D are 0.4 mm off together: PROJ's way back to NTF is not exact.
    adjusted = project(shared_data, "geo-mini-ntf").adjust()
    assert np.sqrt(adjusted.solution.variance_factor) == pytest.approx(5.1005188, rel=2e-6)
    expected = json.loads((shared_data / "comp3d-geo-mini-ntf" / "expected.json").read_text())["points"]
    rows = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    for name, xyz in rows.items():
        gap = np.subtract(expected[name]["cartesian"], expected["A"]["cartesian"])
        np.testing.assert_allclose(xyz - rows["A"], gap, rtol=0, atol=1e-6)
    np.testing.assert_allclose(adjusted.points.crs_coordinates[:, 2], 0.0, atol=0.01)


def test_inner_constraints(shared_data):
    # The rest of the differences are those of sphere and ellipsoid.
    adjusted = project(shared_data, "no-redundancy").adjust()
    assert (adjusted.sigma0, adjusted.precision, adjusted.solution.redundancy) == (None, "a priori", 0)
    expected = json.loads((shared_data / "comp3d-no-redundancy" / "expected.json").read_text())["points"]
    for name, found in zip(adjusted.points.names, adjusted.points.covariances, strict=True):
        given = expected[name]["cov6"]
        np.testing.assert_allclose(
            found[(0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)], given, rtol=3e-5, atol=1e-13
        )
    given = project(shared_data, "no-redundancy").adjust(datum=Datum())
    assert given.points.precisions.max() > 10 * adjusted.points.precisions.max()


def test_what_is_not_determined_is_refused(shared_data, capsys):
    with pytest.raises(SingularSystemError, match="nothing fixes the position along z of c, d"):
        project(shared_data, "desact").adjust()
    with pytest.raises(InputError, match=r"no point is known.*rank deficiency 6"):
        project(shared_data, "kernel").adjust()
    assert main(["adjust", str(shared_data / "comp3d-kernel" / "project.comp")]) == 2
    assert "no point is known" in capsys.readouterr().err


def test_axes_of_rotation(shared_data):
    # comp3d.md 4.3: the origin of the first axis, and 28 equations for both.
    adjusted = project(shared_data, "axe").adjust()
    rows = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    np.testing.assert_allclose(rows["axe1"], (100.0019389, 200.0023833, 59.9960786), rtol=0, atol=3e-6)


def test_covariances_of_a_baseline_are_used(shared_data):
    adjusted = project(shared_data, "baselines").adjust()
    record = adjusted.to_dict()
    vectors = [row for row in record["observations"] if row["type"].startswith("V")]
    assert [row["type"] for row in vectors[:3]] == ["VX", "VY", "VZ"]
    assert vectors[0]["sigma"] == pytest.approx(np.sqrt(7.7350e-09), rel=1e-9)


CONFIG = {"root_COR_file": "p.cor", "root_OBS_file": "o.obs", "files_unit": 1, "local_center": [0, 0, 0]}
EARTH = {"use_proj": True, "proj_def": "+proj=sterea +lat_0=48.8 +lon_0=0 +datum=WGS84"}
POINTS = "1 A 0 0 10 0.001 0.001 0.001\n1 B 0 100 10 0.001 0.001 0.001\n0 P 40 50 10\n"
KNOWN = POINTS.replace("0 P 40 50 10", "1 P 40 50 10 1 1 1")
LINES = "7 A B 0 0.001\n5 A P 42.9548 0.001\n3 A P 64.0312 0.001\n3 B P 64.0312 0.001\n4 A P 0 0.001\n"


def written(folder, config=None, points=POINTS, lines=LINES, **files):
    settings = CONFIG | (config or {})
    (folder / "n.comp").write_text("data=\n" + json.dumps({"config": settings}))
    (folder / "p.cor").write_text(points)
    (folder / "o.obs").write_text(lines)
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text)
    return folder / "n.comp"


def test_files_that_include_files(tmp_path):
    path = written(tmp_path, lines="@more.obs\n" + LINES, more_obs="8 A B 0 0.001\n")
    book = Network.read_project(path).book
    assert [book.place(row).rsplit("/", 1)[1] for row in (0, 1)] == ["more.obs:1", "o.obs:2"]


def test_ignored_points_take_their_observations_along(tmp_path):
    path = written(tmp_path, points=POINTS + "0 Q 1 1 1\n-1 Q\n", lines=LINES + "3 A Q 5 0.001\n")
    network = Network.read_project(path)
    assert network.points.names == ("A", "B", "P")
    assert any(
        "1 lines of observations name points that are to be ignored" in text for text in network.book.warnings
    )


@pytest.mark.parametrize(("kind", "told"), [(1, "a propagation"), (2, "a simulation")])
def test_projects_that_are_no_adjustments_are_planned(shared_data, tmp_path, capsys, kind, told):
    """Inner constraints; the precisions are those that Comp3D's own inversion gives, a priori."""
    source = shared_data / "comp3d-no-redundancy"
    shutil.copytree(source, tmp_path / "case")
    path = tmp_path / "case" / "project.comp"
    path.write_text(re.sub(r'"compute_type": *0', f'"compute_type": {kind}', path.read_text()))
    assert main(["plan", str(path), "--no-gains", "--out", str(tmp_path / "out")]) == 0
    assert f"it is {told}, to be planned: obseq plan project.comp" in " ".join(
        capsys.readouterr().out.split()
    )
    found = {
        p["name"]: p for p in json.loads((tmp_path / "out" / "plan.json").read_text())["adjustment"]["points"]
    }
    expected = json.loads((source / "expected.json").read_text())["points"]
    checked = 0
    for name, point in expected.items():
        for axis, row in zip("xyz", (0, 3, 5), strict=True):  # of xx, xy, xz, yy, yz, zz
            wanted = np.sqrt(point["cov6"][row])
            assert found[name][f"s{axis}"] == pytest.approx(wanted, rel=1e-4, abs=1e-9), (name, axis)
            checked += 1
    assert checked == 12


def test_a_datum_is_chosen(tmp_path, capsys):
    lines = LINES + "3 A B 100.004 0.001\n3 A B 100.005 0.001\n6 A B 100 0.001\n6 A P 100 0.001\n"
    path = written(tmp_path, lines=lines)
    network = Network.read_project(path)
    fixed = network.adjust(datum=Datum("fixed"))
    assert fixed.points.precisions[:2].max() == 0.0
    before = network.adjust()
    inner = network.adjust(datum=Datum("inner", ("A", "B")))
    assert inner.solution.n_constraints == 0
    moved = inner.points.coordinates[:2] - before.points.coordinates[:2]
    np.testing.assert_allclose(moved.sum(axis=0), 0.0, atol=1e-8)
    assert np.linalg.norm(np.subtract(*inner.points.coordinates[:2])) > 100.004  # nothing holds the two
    command = ["adjust", str(path), "--datum", "inner", "--datum-points", "A", "B9"]
    assert main(command) == 2
    assert "there is no point B9" in capsys.readouterr().err


@pytest.mark.parametrize("unit", [0, 1, 2, 3])
def test_the_unit_of_angles_is_a_setting(tmp_path, unit):
    factor = (np.pi / 200, 1.0, 0.9, 3240.0)[unit]
    lines = LINES.replace("42.9548 0.001", f"{42.9548 * factor!r} {0.001 * factor!r}")
    lines = lines.replace("0 0.001", f"0 {0.001 * factor!r}", 1)
    book = Network.read_project(written(tmp_path, {"files_unit": unit}, lines=lines)).book
    assert book.observations.values[1] == pytest.approx(42.9548 * np.pi / 200, rel=1e-12)
    assert book.observations.sigmas[0] == pytest.approx(0.001 * np.pi / 200, rel=1e-12)


def test_polar_sub_frames(tmp_path):
    # Frame at S (0, 0, 10), its first axis to the north: P at (30, 40, 20) is at alpha = -atan(30/40).
    alpha, beta, length = -np.arctan2(30, 40), np.arctan2(10, 50), np.sqrt(2600)
    gon = 200 / np.pi
    frame = ["N 0 0 50 0.0001 0.0001 0"]
    frame.append(f"P {alpha * gon:.12f} {beta * gon:.12f} {length:.12f} 0.0001 0.0001 0")
    points = "1 S 0 0 10 0.001 0.001 0.001\n1 N 0 50 10 0.001 0.001 0.001\n0 P 0 1 2\n"
    path = written(tmp_path, points=points, lines="12 S @f.pol V\n", f_pol="\n".join(frame))
    adjusted = Network.read_project(path).adjust()
    np.testing.assert_allclose(adjusted.points.coordinates[2], (30, 40, 20), rtol=0, atol=2e-3)
    assert np.sqrt(adjusted.solution.variance_factor or 0.0) < 1.0


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"config": {"files_unit": 4}}, "config.files_unit is 4; it goes from 0 to 3"),
        ({"config": {"files_unit": 1.0}}, "config.files_unit is 1.0; it goes from 0 to 3"),
        ({"config": {"refraction": "k"}}, "config.refraction is 'k'"),
        ({"config": {"root_OBS_file": "none.obs"}}, "none.obs: there is no such file"),
        ({"config": {"compute_type": 3}}, "config.compute_type is 3; it is 0, 1 or 2"),
        ({"lines": "@o.obs\n"}, "more than 5 levels deep"),
        ({"lines": "@../../o.obs\n"}, "outside the folder of the project"),
        ({"lines": "10 A B 1 1\n"}, "o.obs:1: '10' is not a code of Comp3D"),
        ({"lines": "18 A @a.axe\n", "a_axe": "1 1 P 0.001\n"}, "a.axe:1: 4 fields where 5 are needed"),
        (
            {"lines": "18 A @a.axe\n", "a_axe": "1 1 P 0.001 0.001\n", "points": KNOWN},
            "no direction of axis A can be found",
        ),
        ({"config": EARTH, "lines": "19 A @b.bas\n", "b_bas": "P 1 2 3 1 2 0 1 0 1\n"}, "b.bas:1: the cov"),
        ({"lines": "11 A @s.xyz X\n", "s_xyz": "P 1 2 3 1\n"}, "o.obs:1: 'X': V or 1"),
        ({"lines": "21 @e.eq\n", "e_eq": "A P 0\n"}, "e.eq:1: a sigma of 0"),
        ({"lines": "-11 A @s.xyz\n"}, "a file of observations has no sign"),
        ({"config": {"coord_cov_file": "c.csv"}, "c_csv": "param A_x\n,\n"}, "c.csv:2: the row of A_x"),
        ({"config": {"coord_cov_file": "c.csv"}, "c_csv": ",\n"}, "c.csv:1: the first line"),
    ],
)
def test_bad_input_is_refused_by_file_and_line(tmp_path, files, message):
    path = written(tmp_path, **files)
    with pytest.raises(InputError) as caught:
        Network.read_project(path).adjust()
    assert message in str(caught.value)


def test_files_from_outside_the_folder_are_told(tmp_path):
    (tmp_path / "in").mkdir()
    path = written(tmp_path / "in", lines="@../more.obs\n3 A B 10 0.001\n")
    (tmp_path / "more.obs").write_text("3 A B 10 0.001\n")
    told = Network.read_project(path, outside=True).book.warnings
    assert [one for one in told if "from outside" in one] == [
        f"{tmp_path / 'in' / '..' / 'more.obs'}: read from outside the folder of the project"
    ]


def test_a_missing_setting_is_told(tmp_path):
    network = Network.read_project(written(tmp_path))
    assert any("refraction is missing; 0.12 is taken" in warning for warning in network.book.warnings)


def test_something_else_is_no_project(tmp_path):
    (tmp_path / "n.comp").write_text("hello")
    with pytest.raises(InputError, match="is not a Comp3D project"):
        Network.read_project(tmp_path / "n.comp")
    (tmp_path / "n.txt").write_text("hello")
    with pytest.raises(InputError, match=r"format is not known; .*Comp3D \(\.comp\)"):
        Network.read_project(tmp_path / "n.txt")
