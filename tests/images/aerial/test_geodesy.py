import numpy as np
import pytest
from cases import FOLDER, TYPES, cases, check, geoid, identify, lambert93

from obseq.errors import CrsError, InputError
from obseq.images.aerial import (
    ApproximateFrames,
    Geoid,
    HeightType,
    LocalFrames,
    MapSystem,
    add_alteration,
    angles_from_matrices,
    convert_heights,
    matrices_from_angles,
    read_ground_points,
    remove_alteration,
)


def test_the_data_are_there(shared_data):
    assert (shared_data / "borea").is_dir()
    assert len(cases("geodesy")) > 5


@pytest.mark.parametrize("case", cases("geodesy"), ids=identify)
def test_geodesy(case):
    inputs = case["inputs"]
    system = MapSystem(inputs["epsg"])
    point = np.array([[inputs["x"], inputs["y"], inputs["z"]]])
    geodetic = system.geodetic(point[:, :2])
    geocentric = system.geocentric(point)
    lon, lat = np.rad2deg(geodetic[0])
    check(
        case,
        lon_deg=lon,
        lat_deg=lat,
        geocentric=geocentric[0],
        gamma_deg_borea_sign=np.rad2deg(system.convergence(geodetic)[0]),
        alpha_meridional_scale_minus_1=system.alteration(point[:, :2])[0],
    )
    np.testing.assert_allclose(system.from_geocentric(geocentric), point, rtol=0.0, atol=5e-9)


@pytest.mark.parametrize("case", [c for c in cases("geodesy") if "geoid" in c["inputs"]], ids=identify)
def test_geoid(case):
    inputs = case["inputs"]
    plan, z = np.array([[inputs["x"], inputs["y"]]]), np.array([inputs["z"]])
    altitude, height = HeightType.ALTITUDE, HeightType.HEIGHT
    check(
        case,
        height_from_altitude=convert_heights(z, plan, altitude, height, lambert93(), geoid())[0],
        altitude_from_height=convert_heights(z, plan, height, altitude, lambert93(), geoid())[0],
    )


@pytest.mark.parametrize("case", cases("rotation"), ids=identify)
def test_rotation(case):
    inputs, expected = case["inputs"], case["expected"]
    stored = np.array([inputs["ori_shot_as_stored"]])
    angles = np.deg2rad(stored) if inputs["unit_angle"] == "degree" else stored
    matrices = matrices_from_angles(angles, inputs["order_axe"])
    check(case, mat_rot_rows=matrices[0])
    for order, wanted in expected["ori_shot_after_set_order_axe"].items():
        found = angles_from_matrices(matrices, order)
        found = np.rad2deg(found) if inputs["unit_angle"] == "degree" else found
        np.testing.assert_allclose(found[0], wanted, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("order", ["opk", "okp", "pok", "pko", "kop", "kpo"])
def test_angles_come_back_in_any_order(order):
    angles = np.random.default_rng(3).uniform(-1.5, 1.5, (20, 3))
    np.testing.assert_allclose(
        angles_from_matrices(matrices_from_angles(angles, order), order), angles, atol=1e-13
    )


@pytest.mark.parametrize("order", ["opkp", "opi", "", "ook"])
def test_wrong_orders_are_refused(order):
    with pytest.raises(InputError, match="permutation"):
        matrices_from_angles(np.zeros((1, 3)), order)


@pytest.mark.parametrize("case", cases("local_frame"), ids=identify)
def test_local_frame(case):
    inputs = case["inputs"]
    frame = LocalFrames(MapSystem(inputs["epsg"]), np.array([[inputs["x_central"], inputs["y_central"]]]))
    world = np.array(inputs["world_points_rows_xyz"])
    seen = frame.to_euclidean(world)
    matrix = matrices_from_angles(np.deg2rad([inputs["mat_rot_from_opk_deg"]]))
    place = np.array([inputs["mat_at_xy"]])
    turned = frame.to_frame(matrix, place)
    check(
        case,
        rot_to_euclidean_local=frame.axes[0],
        eucli_points_rows_xyz=seen,
        back_to_world=frame.to_map(seen),
        mat_eucli=turned[0],
    )
    np.testing.assert_allclose(frame.from_frame(turned, place), matrix, atol=1e-14)


@pytest.mark.parametrize("case", cases("approx_frame"), ids=identify)
def test_approximate_frame(case):
    inputs = case["inputs"]
    frame = ApproximateFrames(np.array([[inputs["x_central"], inputs["y_central"]]]))
    seen = frame.to_euclidean(np.array([inputs["world"]]))
    check(case, eucli=seen[0], back=frame.to_map(seen)[0])


@pytest.mark.parametrize("case", cases("linear_alteration"), ids=identify)
def test_linear_alteration(case):
    inputs = case["inputs"]
    place = np.array([inputs["pos_shot"]])
    alteration = MapSystem(inputs["epsg"]).alteration(place[:, :2])
    nadir = np.array([inputs["z_nadir"]])
    removed = remove_alteration(place[:, 2], alteration, nadir)
    added = add_alteration(place[:, 2], alteration, nadir)
    check(case, z_removed=removed[0], z_added=added[0])
    np.testing.assert_allclose(add_alteration(removed, alteration, nadir), place[:, 2], atol=1e-9)


def test_geocentric_coordinates_come_back_from_the_sea_floor_to_orbit():
    system = MapSystem(2154)
    geodetic = np.deg2rad([[3.0, 46.5], [-4.0, 48.0], [7.5, 43.0], [3.0, -89.0], [10.0, 0.0]])
    for height in (-11_000.0, 0.0, 4810.0, 800_000.0):
        place = system.ellipsoid.geocentric(geodetic, np.full(5, height))
        found, up = system.ellipsoid.geodetic(place)
        np.testing.assert_allclose(found, geodetic, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(up, height, rtol=0.0, atol=4e-9)


def test_a_grid_that_is_not_there_is_named():
    with pytest.raises(InputError, match=r"no_such_geoid\.tif"):
        Geoid("no_such_geoid")


@pytest.mark.skipif(not FOLDER.is_dir(), reason="the geoid grid is among the shared data, which are absent")
def test_outside_the_geoid_is_said():
    system = MapSystem(32633)
    with pytest.raises(CrsError, match="outside the geoid grid"):
        convert_heights(
            np.zeros(1), np.array([[5e5, 6e6]]), TYPES["altitude"], TYPES["height"], system, geoid()
        )


def test_a_conversion_without_geoid_is_refused():
    with pytest.raises(InputError, match="give the geoid grid"):
        convert_heights(
            np.zeros(1), np.zeros((1, 2)), HeightType.ALTITUDE, HeightType.HEIGHT, lambert93(), None
        )


@pytest.mark.parametrize(
    ("definition", "reason"),
    [
        ("EPSG:4326", "not a projected system"),
        ("EPSG:2225", "US survey foot"),
        ("nonsense", "Unknown coordinate system"),
    ],
)
def test_systems_that_do_not_serve_are_refused(definition, reason):
    with pytest.raises(CrsError, match=reason):
        MapSystem(definition)


@pytest.mark.parametrize("case", cases("transform_proj_points"), ids=identify)
def test_points_go_to_another_system(case):
    """The original gives latitude first, as EPSG:4326 says; longitude comes first here, always."""
    inputs = case["inputs"]
    known = read_ground_points(FOLDER / inputs["file"], "PTXYZ")
    system = MapSystem(inputs["epsg_in"])
    found = system.to_system(known.coordinates[:, :2], f"EPSG:{inputs['epsg_out']}")
    altitude, height = HeightType.ALTITUDE, HeightType.HEIGHT
    z = convert_heights(known.coordinates[:, 2], known.coordinates[:, :2], altitude, height, system, geoid())
    for key, heights in (("z_unchanged", known.coordinates[:, 2]), ("altitude_to_height", z)):
        wanted = case["expected"][key]
        assert [row[0] for row in wanted] == list(known.names)
        np.testing.assert_allclose(found[:, ::-1], [row[1:3] for row in wanted], rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(heights, [row[3] for row in wanted], rtol=0.0, atol=1e-3)


def test_another_system_that_proj_does_not_know_is_named():
    with pytest.raises(CrsError, match="EPSG:999999"):
        lambert93().to_system(np.zeros((1, 2)), "EPSG:999999")
