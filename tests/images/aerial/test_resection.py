import numpy as np
import pytest
from cases import FOLDER, cases, check, geoid, identify, lambert93, terrain, worksite

from obseq.errors import InputError, SingularSystemError
from obseq.images.aerial import (
    ConstantHeight,
    FrameCamera,
    HeightType,
    Shots,
    Worksite,
    add_alteration,
    convert_heights,
    fit_rpc,
    read_camera,
    read_ground_points,
    read_image_points,
    resect,
    seed_points,
)

ALTITUDE, HEIGHT = HeightType.ALTITUDE, HeightType.HEIGHT
CAMERA = FrameCamera("c", (500.0, 400.0), 1000.0, (1000, 800))
PLACE = np.array([700000.0, 6600000.0, 1000.0])


def as_altitude(place):
    return convert_heights(place[2:], place[None, :2], HEIGHT, ALTITUDE, lambert93(), geoid())


def view(ground, place=PLACE, angles=(0.05, -0.08, 2.0)):
    """Pixels of ground points in a shot, and its rotation."""
    shots = Shots.from_angles(["s"], [place], [angles], ["c"], height_type=HEIGHT)
    site = Worksite(shots, {"c": CAMERA}, lambert93())
    return site.world_to_image(np.zeros(len(ground), dtype=np.int64), ground), shots.matrices[0]


def scattered(count, seed=5, spread=350.0, relief=150.0):
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3))
    return PLACE * [1.0, 1.0, 0.0] + drawn * [spread, spread, relief]


@pytest.mark.parametrize("with_position", [False, True])
@pytest.mark.parametrize("case", cases("space_resection_points"), ids=identify)
def test_from_points_only(case, with_position):
    inputs = case["inputs"]
    known = read_ground_points(FOLDER / "all_liaisons2_world.mes", "PXYH")
    ground = dict(zip(known.names, known.coordinates, strict=True))
    measured = read_image_points(FOLDER / inputs["image_points"].split()[0])
    rows = [
        row
        for row, (name, shot) in enumerate(zip(measured.names, measured.shots, strict=True))
        if shot == inputs["shot"] and name in ground
    ]
    points = np.array([ground[measured.names[row]] for row in rows])
    position = np.array(inputs["coor_init"], dtype=float) if with_position else None
    camera = read_camera(FOLDER / inputs["camera"])
    found = resect(lambert93(), camera, measured.pixels[rows], points, position=position)
    check(
        case,
        n_points=len(rows),
        rigorous_pos_shot_altitude_no_linear_alteration=[*found.position[:2], *as_altitude(found.position)],
        rigorous_ori_shot_deg=np.rad2deg(found.angles()),
        rigorous_rms_px=np.sqrt((found.residuals**2).mean()),
    )
    assert not found.is_ill_determined


@pytest.mark.parametrize("case", cases("space_resection_gap"), ids=identify)
def test_known_shots_with_shifted_pixels(case):
    inputs = case["inputs"]
    site = worksite()
    row = site.rows([inputs["shot"]])
    pixels, heights = seed_points(site.cameras[site.shots.cameras[row[0]]])
    ground = [
        site.image_to_world(row, pixel[None], ConstantHeight(z, HEIGHT))[0]
        for pixel, z in zip(pixels, heights, strict=True)
    ]
    start = (site.positions(HEIGHT)[row[0]], site.shots.matrices[row[0]])
    camera = site.cameras[site.shots.cameras[row[0]]]
    found = resect(lambert93(), camera, pixels + inputs["add_pixel"], np.array(ground), start=start)
    alteration = lambert93().alteration(found.position[None, :2])
    z = add_alteration(as_altitude(found.position), alteration, site.shots.nadir[row])
    check(
        case,
        rigorous_pos_shot=[*found.position[:2], *z],
        rigorous_ori_shot_deg=np.rad2deg(found.angles()),
        rigorous_rms_px=np.sqrt((found.residuals**2).mean()),
    )


@pytest.mark.parametrize("case", cases("space_resection_20_points"), ids=identify)
def test_twenty_points(case):
    site = worksite()
    row = site.rows([case["inputs"]["shot"]])
    pixels, heights = seed_points(site.cameras[site.shots.cameras[row[0]]])
    ground = [
        site.image_to_world(row, pixel[None], ConstantHeight(z, HEIGHT))[0]
        for pixel, z in zip(pixels, heights, strict=True)
    ]
    check(case, image_col_line=pixels, rigorous_world_xyz=ground)


@pytest.mark.parametrize("count", [4, 5, 30])
def test_an_exact_view_is_found(count):
    ground = scattered(count)
    pixels, matrix = view(ground)
    found = resect(lambert93(), CAMERA, pixels, ground)
    np.testing.assert_allclose(found.position, PLACE, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.matrix, matrix, rtol=0.0, atol=1e-9)
    assert not found.is_ill_determined


def test_precisions_are_those_of_simulated_measures():
    ground = scattered(12)
    pixels, matrix = view(ground)
    noise = np.random.default_rng(8).normal(0.0, 0.5, (300, *pixels.shape))
    drawn = [resect(lambert93(), CAMERA, pixels + off, ground, start=(PLACE, matrix)) for off in noise]
    places = np.array([one.position for one in drawn])
    stated = np.mean([np.diag(one.covariance)[:3] for one in drawn], axis=0)
    np.testing.assert_allclose(places.var(axis=0) / stated, 1.0, atol=0.25)
    assert np.mean([one.sigma0**2 for one in drawn]) == pytest.approx(0.25, rel=0.1)


def on_a_circle(count, heights):
    """Ground points on an upright cylinder that passes through the centre."""
    turn, radius = np.linspace(0.3, 4.4, count), 300.0
    return np.column_stack(
        [PLACE[0] - radius + radius * np.cos(turn), PLACE[1] + radius * np.sin(turn), np.full(count, heights)]
    )


def test_on_the_danger_cylinder_three_points_leave_a_pose_open():
    """Three points and the centre on the cylinder over their circle: a small motion changes no pixel."""
    ground = on_a_circle(3, 0.0)
    pixels, matrix = view(ground, angles=(0.0, 0.0, 0.0))
    found = resect(lambert93(), CAMERA, pixels, ground, start=(PLACE, matrix))
    assert found.is_ill_determined
    assert np.isnan(found.sigma0)
    beside = PLACE + np.array([150.0, 0.0, 0.0])
    pixels, matrix = view(ground, beside, (0.0, 0.0, 0.0))
    found = resect(lambert93(), CAMERA, pixels, ground, start=(beside, matrix))
    assert not found.is_ill_determined


@pytest.mark.parametrize("away", [0.0, 0.5])
def test_a_fourth_point_close_to_one_of_them_does_not_help(away):
    ground = on_a_circle(3, 0.0)
    ground = np.vstack([ground, ground[0] + away])
    pixels, matrix = view(ground, angles=(0.0, 0.0, 0.0))
    assert resect(lambert93(), CAMERA, pixels, ground, start=(PLACE, matrix)).is_ill_determined


def test_points_close_together_leave_a_pose_open():
    ground = scattered(6, spread=1.0, relief=0.5)
    pixels, matrix = view(ground)
    found = resect(lambert93(), CAMERA, pixels, ground, start=(PLACE, matrix))
    assert found.is_ill_determined


def test_three_points_are_too_few():
    ground = scattered(3)
    pixels, _ = view(ground)
    with pytest.raises(InputError, match="at least 4 points"):
        resect(lambert93(), CAMERA, pixels, ground)


def test_points_in_one_place_are_refused():
    ground = np.repeat(scattered(1), 5, axis=0)
    pixels, _ = view(ground)
    with pytest.raises(SingularSystemError, match="one place"):
        resect(lambert93(), CAMERA, pixels, ground)


@pytest.mark.parametrize("case", cases("rpc"), ids=identify)
def test_rpc(case):
    inputs, expected = case["inputs"], case["expected"]
    site = worksite()
    row = site.rows([inputs["shot"]])[0]
    camera = site.cameras[site.shots.cameras[row]]
    bare = fit_rpc(
        site, row, camera, terrain(), degree=inputs["order"], step=inputs["size_grid"], layers=(0.0,)
    )
    check(case, **{f"{key}_OFF": value for key, value in bare.offsets.items()})
    check(case, **{f"{key}_SCALE": value for key, value in bare.scales.items()})
    layered = fit_rpc(site, row, camera, terrain(), degree=inputs["order"], step=inputs["size_grid"])
    for point in expected["evaluation"]:
        place = np.array([point["lon_lat_h"]])
        np.testing.assert_allclose(bare.project(place)[0], point["rpc_col_line"], rtol=0.0, atol=0.5)
        np.testing.assert_allclose(layered.project(place)[0], point["rigorous_col_line"], rtol=0.0, atol=1e-4)
    assert layered.text().count("COEFF") == 80
