import dataclasses

import numpy as np
import pytest
from cases import FOLDER, TYPES, cases, check, geoid, identify, lambert93, terrain, worksite

from obseq.errors import InputError
from obseq.images.aerial import (
    ConstantHeight,
    FrameCamera,
    HeightType,
    Shots,
    Terrain,
    Worksite,
    intersect_pairs,
    intersect_rays,
    most_distant_pairs,
    read_ground_points,
    read_image_points,
    read_terrain,
    residual_statistics,
)


def one_shot(**options):
    """A shot that looks straight down at (700000, 6600000), 1500 m up, on the map itself."""
    shots = Shots.from_angles(
        ["A", "B"],
        [[700000.0, 6600000.0, 1500.0], [700400.0, 6600000.0, 1500.0]],
        np.zeros((2, 3)),
        ["cam", "cam"],
        height_type=HeightType.HEIGHT,
    )
    return Worksite(
        shots, {"cam": FrameCamera("cam", (500.0, 400.0), 1000.0, (1000, 800))}, lambert93(), **options
    )


def approximate(inputs):
    return dataclasses.replace(worksite(), is_approximate=bool(inputs.get("approx")))


@pytest.mark.parametrize("case", cases("z_nadir"), ids=identify)
def test_ground_under_shots_and_positions(case):
    site = worksite()
    row = site.rows([case["inputs"]["shot"]])[0]
    check(
        case,
        z_nadir=site.shots.nadir[row],
        pos_for_height_data=site.positions(HeightType.HEIGHT)[row],
        pos_for_altitude_data=site.positions(HeightType.ALTITUDE)[row],
    )


@pytest.mark.parametrize("case", cases("world_to_image"), ids=identify)
def test_world_to_image(case):
    inputs = case["inputs"]
    site = approximate(inputs)
    points = np.array(inputs["world_points"])
    rows = site.rows([inputs["shot"]] * len(points))
    check(case, image_points_col_line=site.world_to_image(rows, points, TYPES[inputs["type_z_data"]]))


@pytest.mark.parametrize("case", cases("image_to_world"), ids=identify)
def test_image_to_world(case):
    inputs = case["inputs"]
    site, pixels = worksite(), np.array(inputs["image_points"])
    rows = site.rows([inputs["shot"]] * len(pixels))
    check(
        case,
        rigorous_fixed_z_50=site.image_to_world(rows, pixels, ConstantHeight(50.0, HeightType.HEIGHT)),
        borea_dtm_out_height=site.image_to_world(rows, pixels, terrain(), HeightType.HEIGHT),
        borea_dtm_out_altitude=site.image_to_world(rows, pixels, terrain(), HeightType.ALTITUDE),
    )


def test_what_is_seen_on_the_ground_projects_back_to_its_pixel(shared_data):
    assert (shared_data / "borea").is_dir()
    site = worksite()
    pixels = np.random.default_rng(1).uniform([0, 0], [26460, 17004], (200, 2))
    rows = np.arange(200) % len(site.shots)
    ground = site.image_to_world(rows, pixels, terrain(), HeightType.HEIGHT)
    np.testing.assert_allclose(ground[:, 2], terrain().z(ground[:, :2]), rtol=0.0, atol=2e-6)
    back = site.world_to_image(rows, ground, HeightType.HEIGHT)
    np.testing.assert_allclose(back, pixels, rtol=0.0, atol=1e-5)


def test_a_nadir_view_by_hand():
    """100 m to the east at 1500 m above the ground: 1000 px x 100 / 1500, and the scale of the map."""
    site = one_shot()
    scale = 1.0 + lambert93().alteration(np.array([[700000.0, 6600000.0]]))[0]
    pixel = site.world_to_image(np.array([0]), np.array([[700100.0, 6600050.0, 0.0]]))
    np.testing.assert_allclose(
        pixel[0], [500.0 + 1000.0 / 15.0 / scale, 400.0 - 1000.0 / 30.0 / scale], rtol=0.0, atol=2e-3
    )


def test_a_point_behind_the_camera_has_no_pixel():
    site = one_shot()
    assert np.isnan(site.world_to_image(np.array([0]), np.array([[700000.0, 6600000.0, 1600.0]]))).all()


def test_a_ray_that_leaves_the_terrain_has_no_ground():
    grid = Terrain(np.full((2, 2), 10.0), 699900.0, 6600100.0, (100.0, 100.0), HeightType.HEIGHT)
    site = one_shot()
    ground = site.image_to_world(np.array([0, 0]), np.array([[500.0, 400.0], [900.0, 400.0]]), grid)
    assert np.isfinite(ground[0]).all()
    assert np.isnan(ground[1]).all()


def test_a_hole_in_the_terrain_has_no_height():
    values = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0], [7.0, 8.0, 9.0]])
    grid = Terrain(values, 0.0, 30.0, (10.0, 10.0), HeightType.HEIGHT)
    z = grid.z(np.array([[5.0, 25.0], [10.0, 25.0], [12.0, 18.0], [25.0, 15.0], [0.0, 30.0], [-0.1, 30.0]]))
    np.testing.assert_allclose(z, [1.0, 1.5, np.nan, 6.0, 1.0, np.nan])


def test_a_terrain_with_too_few_values_is_refused(tmp_path):
    path = tmp_path / "short.asc"
    path.write_text("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n")
    with pytest.raises(InputError, match="holds 3 values"):
        read_terrain(path, None)


def test_alteration_without_ground_is_said_and_left(logged):
    site = one_shot()
    altered = dataclasses.replace(site, shots=dataclasses.replace(site.shots, has_alteration=True))
    assert altered.positions(HeightType.HEIGHT)[0, 2] == 1500.0
    assert "unknown ground" in logged[0].getMessage()


def seed_site(inputs):
    shots = Shots.from_angles(
        ["1", "2"],
        [inputs["shot1"]["pos"], inputs["shot2"]["pos"]],
        np.deg2rad([inputs["shot1"]["opk_deg"], inputs["shot2"]["opk_deg"]]),
        ["c", "c"],
        height_type=TYPES[inputs.get("type_z_shot")],
        has_alteration=inputs["linear_alteration"],
    )
    site = Worksite(shots, {"c": FrameCamera("c", (13210.0, 8502.0), 30975.0)}, lambert93(), geoid())
    if inputs.get("dtm"):
        site = site.with_nadir(terrain())
    return dataclasses.replace(site, is_approximate=bool(inputs.get("approx"))), [0, 1]


@pytest.mark.parametrize("case", cases("intersection_2p"), ids=identify)
def test_two_rays(case):
    inputs, expected = case["inputs"], case["expected"]
    if "opk" in inputs:
        site, rows = approximate(inputs), worksite().rows([inputs["shot1"], inputs["shot2"]])
    else:
        site, rows = seed_site(inputs)
    kind = TYPES[inputs.get("type_z_data")]
    found = intersect_pairs(site, np.array([rows]), np.array([[inputs["image_1"], inputs["image_2"]]]), kind)
    check(case, world=found.points[0], t1=found.reach[0, 0], t2=found.reach[0, 1])
    if "gap_norm" in expected:
        check(case, gap_norm=found.gaps[0])


@pytest.mark.parametrize("case", cases("intersection_2p"), ids=identify)
def test_what_happens_inside_two_rays(case):
    inputs = case["inputs"]
    site, rows = (
        (approximate(inputs), list(worksite().rows([inputs["shot1"], inputs["shot2"]])))
        if "opk" in inputs
        else seed_site(inputs)
    )
    places = site.shots.positions[rows, :2]
    centre = places.mean(axis=0)[None]
    frame = site.frames(centre)
    seen = frame.to_euclidean(site.positions(TYPES[inputs.get("type_z_data")])[rows])
    turn = frame.to_frame(site.shots.matrices[rows], places)
    pixels = np.array([inputs["image_1"], inputs["image_2"]])
    rays = np.einsum("nji,nj->ni", turn, site.directions(np.array(rows), pixels))
    check(case, pos_eucli_1=seen[0], pos_eucli_2=seen[1], vect_1=rays[0], vect_2=rays[1])


@pytest.mark.parametrize("case", cases("intersection_multi"), ids=identify)
def test_the_most_distant_pair(case):
    inputs = case["inputs"]
    site = worksite()
    measured = read_image_points(FOLDER / inputs["points"])
    chosen = np.array([name == inputs["name"] for name in measured.names])
    shots = site.rows(np.array(measured.shots)[chosen])
    pixels = measured.pixels[chosen]
    pair = most_distant_pairs(site, np.zeros(len(shots), dtype=np.int64), shots, 1)
    found = intersect_pairs(site, shots[pair], pixels[pair], TYPES[inputs["type_z_data"]])
    check(case, world=found.points[0])


@pytest.mark.parametrize("case", cases("n_ray_least_squares"), ids=identify)
def test_all_rays(case):
    inputs = case["inputs"]
    site = worksite(inputs["opk"])
    rows = site.rows(name for name, _ in inputs["images"])
    pixels = np.array([pixel for _, pixel in inputs["images"]])
    found = intersect_rays(
        site, np.zeros(len(rows), dtype=np.int64), rows, pixels, 1, TYPES[inputs["type_z_data"]]
    )
    check(
        case,
        rigorous_world=found.points[0],
        rigorous_residuals_px_col_line=found.residuals,
        rigorous_sum_sq_px2=(found.residuals**2).sum(),
    )


def test_the_world_points_of_the_large_block(shared_data):
    """Every point of the file that Borea wrote, from the most distant pair of its shots."""
    measured = read_image_points(shared_data / "borea" / "all_liaisons2.mes")
    site = worksite("23FD1305_alt_2.OPK")
    names = {name: index for index, name in enumerate(dict.fromkeys(measured.names))}
    point = np.array([names[name] for name in measured.names])
    shots = site.rows(measured.shots)
    pairs = most_distant_pairs(site, point, shots, len(names))
    rows = np.flatnonzero(pairs[:, 0] >= 0)
    found = intersect_pairs(site, shots[pairs[rows]], measured.pixels[pairs[rows]], HeightType.HEIGHT)
    ground = dict(zip(rows, found.points, strict=True))
    off = []
    for line in (shared_data / "borea" / "all_liaisons2_world.mes").read_text().splitlines():
        name, *place = line.split()
        off.append(ground[names[name]] - np.array(place, dtype=float))
    assert len(off) == 2004
    assert np.abs(off).max(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.003)
    assert np.abs(off)[:, :2].max() < 0.001


@pytest.mark.parametrize("approximately", [False, True])
def test_covariances_of_two_rays_are_those_of_simulated_measures(approximately):
    site = dataclasses.replace(one_shot(), is_approximate=approximately)
    rng = np.random.default_rng(11)
    exact = np.array([[800.0, 250.0], [530.0, 244.0]])
    drawn = np.broadcast_to(exact, (20_000, 2, 2)) + rng.normal(0.0, 0.3, (20_000, 2, 2))
    rows = np.broadcast_to([0, 1], (20_000, 2))
    found = intersect_pairs(site, rows, drawn)
    stated = intersect_pairs(site, rows[:1], exact[None], sigma=0.3).covariances[0]
    simulated = np.cov(found.points.T)
    scale = np.sqrt(np.diag(stated))
    np.testing.assert_allclose(simulated / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.04)


def test_covariances_of_all_rays_are_those_of_simulated_measures():
    site = one_shot()
    rng = np.random.default_rng(12)
    ground = np.array([[700150.0, 6600080.0, 20.0]])
    shots = np.array([0, 1])
    exact = site.world_to_image(shots, np.repeat(ground, 2, axis=0))
    count = 5_000
    point, rows = np.repeat(np.arange(count), 2), np.tile(shots, count)
    drawn = np.tile(exact, (count, 1)) + rng.normal(0.0, 0.3, (2 * count, 2))
    found = intersect_rays(site, point, rows, drawn, count)
    stated = intersect_rays(site, np.zeros(2, dtype=np.int64), shots, exact, 1, sigma=0.3)
    np.testing.assert_allclose(stated.points, ground, rtol=0.0, atol=1e-6)
    scale = np.sqrt(np.diag(stated.covariances[0]))
    np.testing.assert_allclose(
        np.cov(found.points.T) / np.outer(scale, scale),
        stated.covariances[0] / np.outer(scale, scale),
        atol=0.06,
    )


def test_parallel_rays_and_rays_that_meet_behind_have_no_point():
    site = one_shot()
    centre, apart = [500.0, 400.0], [400.0, 400.0]
    pixels = np.array([[centre, centre], [apart, [600.0, 400.0]], [[600.0, 400.0], apart]])
    found = intersect_pairs(site, np.array([[0, 0], [0, 1], [0, 1]]), pixels)
    assert np.isnan(found.points[0]).all()
    assert np.isnan(found.points[1]).all()
    assert (found.reach[1] < 0.0).all()
    assert np.isfinite(found.points[2]).all()


def test_points_without_enough_rays_do_not_disturb_the_others():
    site = one_shot()
    ground = np.array([[700150.0, 6600080.0, 20.0]])
    exact = site.world_to_image(np.array([0, 1]), np.repeat(ground, 2, axis=0))
    point, shots = np.array([0, 1, 1, 2, 2]), np.array([0, 0, 1, 1, 1])
    pixels = np.vstack([[[1.0, 2.0]], exact, [[5.0, 5.0], [5.0, 5.0]]])
    found = intersect_rays(site, point, shots, pixels, 4, sigma=1.0)
    np.testing.assert_allclose(found.points[1], ground[0], rtol=0.0, atol=1e-6)
    assert np.isnan(found.points[[0, 2, 3]]).all()
    assert np.isnan(found.covariances[[0, 2, 3]]).all()
    assert np.isfinite(found.covariances[1]).all()
    assert found.n_rays.tolist() == [1, 2, 2, 0]


def test_a_point_seen_by_one_shot_has_no_pair():
    site = one_shot()
    pairs = most_distant_pairs(site, np.array([0, 1, 1, 2, 2]), np.array([0, 0, 1, 1, 1]), 4)
    assert pairs.tolist() == [[-1, -1], [1, 2], [-1, -1], [-1, -1]]


def test_an_unknown_camera_is_named():
    shots = Shots.from_angles(["A"], [[0, 0, 0]], [[0, 0, 0]], ["other"])
    with pytest.raises(InputError, match="shot A: its camera other is unknown"):
        Worksite(shots, {}, lambert93())


def test_an_unknown_shot_is_named():
    with pytest.raises(InputError, match="shot Z: unknown"):
        one_shot().rows(["A", "Z"])


@pytest.mark.parametrize("case", cases("control"), ids=identify)
def test_control(case):
    site = worksite()
    measured = read_image_points(FOLDER / case["inputs"]["gcp2d"])
    known = read_ground_points(FOLDER / case["inputs"]["gcp3d"].split()[0], "PTXYH")
    ground = dict(zip(known.names, known.coordinates, strict=True))
    rows = site.rows(measured.shots)
    computed = site.world_to_image(
        rows, np.array([ground[name] for name in measured.names]), known.height_type
    )
    wanted = case["expected"]["world_to_image_residuals_observed_minus_computed"]
    np.testing.assert_allclose(measured.pixels - computed, [row[2] for row in wanted], atol=0.003)
    assert [[*pair] for pair in zip(measured.names, measured.shots, strict=True)] == [
        row[:2] for row in wanted
    ]


@pytest.mark.parametrize("case", cases("statistics"), ids=identify)
def test_statistics(case):
    names, residuals = zip(*case["inputs"]["residuals"], strict=True)
    values = np.array(residuals, dtype=float)
    for suffix, given in (("arith", values), ("abs", np.abs(values))):
        found = residual_statistics(names, given)
        assert found.minimum.values.tolist() == case["expected"][f"Min_{suffix}"]["val"]
        assert list(found.maximum.names) == case["expected"][f"Max_{suffix}"]["data"]
        check(
            case,
            **{
                f"Median_{suffix}": found.median,
                f"Mean_{suffix}": found.mean,
                f"Var_{suffix}": found.variance,
                f"Sigma_{suffix}": found.sigma,
            },
        )


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # inside rasterio
def test_a_raster_and_a_grid_of_the_same_ground_are_the_same(tmp_path):
    rasterio = pytest.importorskip("rasterio", reason="rasterio is an extra: pip install obseq[raster]")
    values = np.arange(12.0).reshape(3, 4)
    text = " ".join(str(value) for value in values.ravel()).replace("5.0", "-9999")
    grid = tmp_path / "g.asc"
    grid.write_text(f"ncols 4\nnrows 3\nxllcorner 10\nyllcorner 20\ncellsize 5\n{text}\n")
    values[1, 1] = np.nan
    place = rasterio.transform.from_origin(10.0, 35.0, 5.0, 5.0)
    options = {"driver": "GTiff", "width": 4, "height": 3, "count": 1, "dtype": "float64", "transform": place}
    with rasterio.open(tmp_path / "g.tif", "w", nodata=np.nan, crs="EPSG:2154", **options) as raster:
        raster.write(values, 1)
    plan = np.random.default_rng(1).uniform([9, 19], [31, 36], (200, 2))
    both = [read_terrain(tmp_path / name, None).z(plan) for name in ("g.asc", "g.tif")]
    np.testing.assert_allclose(both[0], both[1], rtol=0.0, atol=1e-12)
    assert np.isnan(both[0]).any()
    assert np.isfinite(both[0]).any()
