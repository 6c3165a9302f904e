"""The numbers that the original's own tests assert, and the formula as it is printed."""

import numpy as np
import pytest
from cases import FOLDER, TYPES, camera_of, cameras, cases, geoid, identify, lambert93, terrain, worksite

from obseq.errors import InputError
from obseq.images.aerial import (
    ApproximateFrames,
    FrameCamera,
    HeightType,
    LocalFrames,
    Shots,
    Worksite,
    intersect_pairs,
    most_distant_pairs,
    read_ground_points,
    read_image_points,
    read_shots,
    resect,
    shots_text,
)
from obseq.images.aerial.heights import convert_heights
from obseq.images.aerial.rays import meet
from obseq.images.aerial.shots import axes_of, unit_of


def published(name):
    """The inputs and expected values of one of the original's own tests."""
    return [case for case in cases("borea_test_assertion") if case["id"] == name]


@pytest.mark.parametrize(
    "case", published("assert-inter-2p") + published("assert-inter-3shots"), ids=identify
)
def test_the_intersections_of_the_original_tests(case):
    inputs = case["inputs"]
    shots = inputs.get("shots") or {"1": inputs["shot1"], "2": inputs["shot2"]}
    pixels = inputs.get("images") or {"1": inputs["image_1"], "2": inputs["image_2"]}
    made = Shots.from_angles(
        list(shots),
        [shot["pos"] for shot in shots.values()],
        np.deg2rad([shot["opk_deg"] for shot in shots.values()]),
        ["c"] * len(shots),
        height_type=TYPES[inputs["type_z_shot"]],
        has_alteration=inputs.get("linear_alteration", True),
    )
    site = Worksite(made, {"c": FrameCamera("c", (13210.0, 8502.0), 30975.0)}, lambert93(), geoid())
    site = site.with_nadir(terrain())
    rows = np.arange(len(shots))
    measured = np.array([pixels[name] for name in shots])
    pair = most_distant_pairs(site, np.zeros(len(rows), dtype=np.int64), rows, 1)
    found = intersect_pairs(site, rows[pair], measured[pair], TYPES[inputs["type_z_data"]])
    np.testing.assert_allclose(
        found.points[0], case["expected"]["world"], rtol=0.0, atol=case["tol"]["world"]
    )


@pytest.mark.parametrize("case", published("assert-i2w"), ids=identify)
def test_the_ground_point_of_the_original_test(case):
    inputs = case["inputs"]
    made = Shots.from_angles(
        ["s"],
        [inputs["shot"]["pos"]],
        np.deg2rad([inputs["shot"]["opk_deg"]]),
        ["c"],
        height_type=TYPES[inputs["type_z_shot"]],
        has_alteration=True,
    )
    site = Worksite(made, {"c": FrameCamera("c", (13210.0, 8502.0), 30975.0)}, lambert93(), geoid())
    site = site.with_nadir(terrain())
    found = site.image_to_world(np.array([0]), np.array([inputs["col_line"]]), terrain(), HeightType.HEIGHT)
    off = np.abs(found[0] - case["expected"]["world"])
    assert (off < case["tol"]["world"]).all()


@pytest.mark.parametrize("case", published("assert-convz"), ids=identify)
def test_the_heights_of_the_original_test(case):
    site = worksite()
    row = site.rows(["23FD1305x00026_01306"])[0]
    assert round(site.positions(HeightType.HEIGHT)[row, 2]) == 1820
    kept = site.positions(HeightType.HEIGHT, keep_alteration=True)[row, 2]
    assert round(kept) == case["expected"]["shot_z_as_height_rounded_m"]


def only(name, kind="borea_test_assertion"):
    """The case of a name, as the only parameter of a test; without the data the test has no cases."""
    return pytest.mark.parametrize("case", [case for case in cases(kind) if case["id"] == name], ids=identify)


@only("assert-proj-out")
def test_another_system_of_the_original_test(case):
    """Longitude stands first here, as x always does (the original keeps the order of the authority)."""
    inputs = case["inputs"]
    found = lambert93().to_system(np.array([[inputs["x"], inputs["y"]]]), f"EPSG:{inputs['epsg_out']}")
    wanted = case["expected"]
    assert found[0].round(3).tolist() == [wanted["y_rounded3"], wanted["x_rounded3"]]


@only("assert-approx-w2e")
def test_the_approximate_frame_of_the_original_test(case):
    """Its y has two digits swapped: 700 m, 1000 m up, are 700.110 m (the original compares signed values)."""
    inputs = case["inputs"]
    frame = ApproximateFrames(np.array([[inputs["x_central"], inputs["y_central"]]]))
    found = frame.to_euclidean(np.array([inputs["world"]], dtype=float))
    x, y, z = case["expected"]["eucli"]
    assert y == 700.101
    np.testing.assert_allclose(found[0], [x, 700.110, z], rtol=0.0, atol=case["tol"]["eucli"])


@only("assert-local-zero")
def test_the_local_frame_far_outside_its_map(case):
    inputs = case["inputs"]
    centre = np.array([[inputs["x_central"], inputs["y_central"]]], dtype=float)
    found = LocalFrames(lambert93(), centre).to_euclidean(np.array([inputs["world"]], dtype=float))
    assert found[0].round().tolist() == case["expected"]["eucli_rounded"]


@only("assert-barycentre")
def test_the_middle_of_shots(case):
    """The original's frame stands on the barycentre of the shots; ours on any centre one gives."""
    barycentre = np.array(case["inputs"]["positions"], dtype=float).mean(axis=0)
    assert barycentre.tolist() == case["expected"]["barycentre"]
    seen = ApproximateFrames(barycentre[None, :2]).to_euclidean(barycentre[None])
    np.testing.assert_allclose(seen[0], [0.0, 0.0, barycentre[2]], rtol=0.0, atol=1e-9)


@only("assert-order-axe")
def test_orders_of_axes(case):
    for order, wanted in case["expected"].items():
        if wanted == "error":
            with pytest.raises(InputError, match="permutation"):
                axes_of(order)
        else:
            assert "".join("xyz"[axis] for axis in axes_of(order)) == wanted


@only("assert-unit-angle")
def test_units_of_angles(case):
    found = np.array(case["inputs"]["radian_in"]) / unit_of("degree")
    np.testing.assert_allclose(found, case["expected"]["degree_out"], rtol=0.0, atol=1e-12)


LINE = dict.fromkeys("PTNCSXYZHOK", "1")


def columns(header):
    return " ".join(LINE.get(letter, "1") for letter in header) + "\n"


def kind_of_header(read, tmp_path, header):
    """What a file of one line under this header holds: a type of height, ``ok`` without one, or ``error``."""
    file = tmp_path / "file.txt"
    file.write_text(columns(header))
    try:
        found = read(file, header)
    except InputError:
        return "error"
    kind = getattr(found[0] if isinstance(found, tuple) else found, "height_type", None)
    return kind.value if kind else "ok"


@only("assert-header")
def test_headers_of_shots(case, tmp_path):
    found = {header: kind_of_header(read_shots, tmp_path, header) for header in case["expected"]}
    assert found == case["expected"]


@only("assert-header-pt")
def test_headers_of_points(case, tmp_path):
    readers = {"gcp3d": read_ground_points, "gcp2d": read_image_points, "co_point": read_image_points}
    for name, wanted in case["expected"].items():
        kind, header = name.split()
        found = kind_of_header(readers[kind], tmp_path, header)
        assert (found == "error") == (wanted == "error"), name
        assert found == wanted or wanted == "ok", name


@only("assert-writer-opk")
def test_shots_are_written_and_read(case, tmp_path):
    """Angles come back within a turn and as one of their two forms; the rotation is what counts."""
    inputs = case["inputs"]
    made = Shots.from_angles(["s"], [inputs["pos"]], np.deg2rad([inputs["ori_deg"]]), ["c"])
    file = tmp_path / "out.opk"
    file.write_text(
        shots_text(made, inputs["header_out"], unit=inputs["unit_out"], order=inputs["order_out"])
    )
    read, _ = read_shots(file, inputs["header_out"], interval=(2, None), unit=inputs["unit_out"])
    wanted = Shots.from_angles(["s"], [case["expected"]["pos"]], [case["expected"]["ori_rad"]], ["c"])
    np.testing.assert_allclose(read.matrices, wanted.matrices, rtol=0.0, atol=1e-12)
    assert read.positions.tolist() == wanted.positions.tolist()


@only("assert-resect-pts")
def test_the_resections_of_the_original_test(case):
    """The original's positions carry the linear alteration; the test allows for it in z."""
    known = read_ground_points(FOLDER / "all_liaisons2_world.mes", "PXYH")
    ground = dict(zip(known.names, known.coordinates, strict=True))
    measured = read_image_points(FOLDER / "all_liaisons2.mes")
    shots, _ = read_shots(FOLDER / "23FD1305_alt_2.OPK", interval=(2, None))
    known_cameras = cameras()
    for name, wanted in case["expected"].items():
        rows = [
            row
            for row, (point, shot) in enumerate(zip(measured.names, measured.shots, strict=True))
            if shot == name and point in ground
        ]
        camera = known_cameras[shots.cameras[shots.index([name])[0]]]
        points = np.array([ground[measured.names[row]] for row in rows])
        start = np.array(case["inputs"]["coor_init"], dtype=float)
        found = resect(lambert93(), camera, measured.pixels[rows], points, position=start)
        z = convert_heights(
            found.position[2:],
            found.position[None, :2],
            HeightType.HEIGHT,
            HeightType.ALTITUDE,
            lambert93(),
            geoid(),
        )
        off = np.abs([*found.position[:2], *z] - np.array(wanted["pos"]))
        assert (off < case["tol"]["pos"]).all(), name
        angles = np.rad2deg(found.angles())
        np.testing.assert_allclose(angles, wanted["opk_deg"], rtol=0.0, atol=case["tol"]["opk_deg"])


@only("assert-take-obs")
def test_the_observations_of_a_resection(case):
    """The original adds 350 m to every z by mistake (B11 of its list): the true heights are compared."""
    inputs, expected = case["inputs"], case["expected"]
    site = worksite(inputs["opk"])
    measured = read_image_points(FOLDER / inputs["points"])
    names = [
        name for name, shot in zip(measured.names, measured.shots, strict=True) if shot == inputs["shot"]
    ][:3]
    pixels, found = [], []
    for name in names:
        chosen = np.array([other == name for other in measured.names])
        shots, seen = site.rows(np.array(measured.shots)[chosen]), measured.pixels[chosen]
        pair = most_distant_pairs(site, np.zeros(len(shots), dtype=np.int64), shots, 1)
        found.append(intersect_pairs(site, shots[pair], seen[pair], HeightType.HEIGHT).points[0])
        pixels.append(seen[np.array(measured.shots)[chosen].tolist().index(inputs["shot"])].tolist())
    assert pixels == expected["image_first_3_points"]
    wanted = np.array(expected["world_first_3_points_rounded"]) - [0.0, 0.0, 350.0]
    np.testing.assert_allclose(
        found, wanted, rtol=0.0, atol=case["tol"]["world_first_3_points_rounded"] + 0.5
    )


def printed(first, towards, second, along, *, base_turned, norm_mistaken):
    """Middle of the feet by the printed formula, with its sign of the base and its norm, or without."""
    base = first - second if base_turned else second - first
    n1, n2, c = towards @ towards, along @ along, towards @ along
    b1, b2 = base @ towards, base @ along
    below = c * c - n1 * n2
    t1 = (b2 * c - b1 * (n1 if norm_mistaken else n2)) / below
    t2 = (b2 * n1 - b1 * c) / below
    return 0.5 * (first + t1 * towards + second + t2 * along)


@only("seed002-formula-variants", "intersection_2p_formula")
def test_the_printed_formula_and_ours(case):
    """What each fault of the printed formula alone would give; without them it is `meet`."""
    inputs = case["inputs"]
    given = [inputs["shot1"], inputs["shot2"]]
    angles = np.deg2rad([shot["opk_deg"] for shot in given])
    shots = Shots.from_angles(
        ["1", "2"], [shot["pos"] for shot in given], angles, ["c", "c"], has_alteration=False
    )
    site = Worksite(shots, {"c": camera_of(inputs)}, lambert93())
    frame = site.frames(shots.positions[:, :2].mean(axis=0)[None])
    centres = frame.to_euclidean(shots.positions)
    pixels = np.array([inputs["image_1"], inputs["image_2"]])
    turns = frame.to_frame(shots.matrices, shots.positions[:, :2])
    rays = np.einsum("nji,nj->ni", turns, site.directions(np.arange(2), pixels))
    expected = case["expected"]["euclidean_point_by_variant"]
    faults = dict(zip(expected, [(True, True), (False, True), (True, False), (False, False)], strict=True))
    for name, (base_turned, norm_mistaken) in faults.items():
        found = printed(
            centres[0], rays[0], centres[1], rays[1], base_turned=base_turned, norm_mistaken=norm_mistaken
        )
        atol = case["tol"]["euclidean_point_by_variant"]
        np.testing.assert_allclose(found, expected[name], rtol=0.0, atol=atol, err_msg=name)
    ours = meet(centres[:1], rays[:1], centres[1:], rays[1:]).middle
    np.testing.assert_allclose(ours[0], expected["both fixed"], rtol=0.0, atol=atol)
    world = frame.to_map(ours)[0]
    np.testing.assert_allclose(
        world,
        case["expected"]["to_world_of_both_fixed"],
        rtol=0.0,
        atol=case["tol"]["to_world_of_both_fixed"],
    )
