"""Conversions: the numbers of MMVII's bench "SysCo" (reference, section 15.3), axes, failures."""

import numpy as np
import pytest

from obseq import crs, geometry
from obseq.crs import CrsError, ProjSystem, Transformer, parse

PARIS = "RTL*657723*6860710*0*L93"


def test_lambert_93_to_geographic() -> None:
    place = Transformer(parse("L93"), parse("+proj=latlong")).forward([657730.0, 6860675.0, 50.0])
    assert place[:2] == pytest.approx([2.42403442, 48.84473383], abs=1e-8)
    assert place[2] == pytest.approx(50.0, abs=1e-5)


def test_pose_of_the_paris_frame() -> None:
    rotation, translation = parse(PARIS).geocentric_pose()
    assert translation == pytest.approx([4201661.926785135, 177860.1878016033, 4779236.016271434], abs=1e-5)
    assert rotation[:, 0] == pytest.approx([-0.042293037933441094, 0.9991052491816668, 0.0], abs=1e-12)
    assert rotation[:, 1] == pytest.approx(
        [-0.7522588760680056, -0.031843805452299215, 0.6580976792477065], abs=1e-12
    )
    assert rotation[:, 2] == pytest.approx(
        [0.6575088458106564, 0.027832950112332798, 0.7529325630949846], abs=1e-12
    )
    assert parse(PARIS).from_geocentric(translation) == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize("through", ["GeoC", "L93", "RTL*0.67451979*45.18899334*0.00000000*EPSG:4326"])
def test_round_trip_of_the_paris_frame(through) -> None:
    there = Transformer(parse(PARIS), parse(through))
    point = np.array([[100.0, 10.0, 1.0]])
    assert there.inverse(there.forward(point)) == pytest.approx(point, abs=1e-7)


def test_round_trip_of_lambert_93_through_a_frame() -> None:
    there = Transformer(parse("L93"), parse("RTL*0.67451979*45.18899334*0.00000000*EPSG:4326"))
    point = np.array([521565.580, 6459960.990, 252.830])
    inside = there.forward(point)
    assert there.inverse(inside) == pytest.approx(point, abs=1e-7)
    # the frame is at longitude 0.67, near the point; read latitude first it would be 6000 km away
    assert np.linalg.norm(inside) < 6000.0


def test_going_up_the_normal_adds_height_and_nothing_else() -> None:
    geographic = parse("Geog")
    lon, lat = np.deg2rad([2.4240, 48.8447])
    normal = np.array([np.cos(lon) * np.cos(lat), np.sin(lon) * np.cos(lat), np.sin(lat)])
    higher = geographic.from_geocentric(geographic.to_geocentric([2.4240, 48.8447, 100.0]) + 1000.0 * normal)
    assert higher == pytest.approx([2.4240, 48.8447, 1100.0], abs=1e-9, rel=0)


@pytest.mark.parametrize(
    ("definition", "lon", "lat"),
    [
        ("RTL*0*44.40*0*EPSG:4326", 0.0, 44.40),
        ("RTL*45*0*0*+proj=latlong", 45.0, 0.0),
        ("RTL*55*-30*0*Geog", 55.0, -30.0),
        ("RTL*2.5*48*0*EPSG:4979", 2.5, 48.0),
    ],
)
def test_longitude_comes_first(definition, lon, lat) -> None:
    frame = parse(definition)
    a, b = 6378137.0, 6356752.314245179
    up = [
        np.cos(np.deg2rad(lat)) * np.cos(np.deg2rad(lon)),
        np.cos(np.deg2rad(lat)) * np.sin(np.deg2rad(lon)),
    ]
    up.append(np.sin(np.deg2rad(lat)))
    _, translation = frame.geocentric_pose()
    # a point of the ellipsoid whose normal is `up`: (a^2 ux, a^2 uy, b^2 uz) / |(a ux, a uy, b uz)|
    scale = np.sqrt((a * up[0]) ** 2 + (a * up[1]) ** 2 + (b * up[2]) ** 2)
    expected = np.array([a * a * up[0], a * a * up[1], b * b * up[2]]) / scale
    assert translation == pytest.approx(expected, abs=1e-6, rel=0)
    place = frame.geodetic([[0.0, 0.0, 0.0], [0.0, 0.0, 20.0]])
    assert np.rad2deg(place[:, :2]) == pytest.approx(np.array([[lon, lat]] * 2), abs=1e-12)
    assert place[:, 2] == pytest.approx([0.0, 20.0], abs=1e-8)


def meridian_arc(latitude: float) -> float:
    """Length of the meridian of GRS 80 from the equator, metres (series to e^6)."""
    a, e2 = 6378137.0, 0.00669438002
    e4, e6 = e2**2, e2**3
    terms = (
        (1 - e2 / 4 - 3 * e4 / 64 - 5 * e6 / 256) * latitude
        - (3 * e2 / 8 + 3 * e4 / 32 + 45 * e6 / 1024) * np.sin(2 * latitude)
        + (15 * e4 / 256 + 45 * e6 / 1024) * np.sin(4 * latitude)
        - (35 * e6 / 3072) * np.sin(6 * latitude)
    )
    return float(a * terms)


def test_northing_first_systems_are_read_easting_first() -> None:
    """EPSG:2193 (New Zealand) is northing, easting by its authority."""
    # on the central meridian, 4 600 000 / 0.9996 = 4 601 841 m of meridian south of the equator
    place = Transformer(parse("EPSG:2193"), parse("Geog")).forward([1600000.0, 5400000.0, 0.0])
    assert place[0] == pytest.approx(173.0, abs=1e-9)
    assert meridian_arc(np.deg2rad(place[1])) == pytest.approx(-4600000.0 / 0.9996, abs=0.1)


@pytest.mark.parametrize(
    "definition",
    [
        "IGNF:LAMB93",
        "EPSG:2154",
        "EPSG:32631",
        "EPSG:25831",
        "+proj=utm +zone=31 +datum=WGS84",
        "+proj=utm +zone=31 +ellps=intl +towgs84=-87,-98,-121",
        "+proj=lcc +lat_1=44 +lat_2=49 +lat_0=46.5 +lon_0=3 +x_0=700000 +y_0=6600000 +ellps=GRS80 "
        "+towgs84=0,0,0,0,0,0,0 +units=m +no_defs",
        "+init=IGNF:LAMB93",
        "EPSG:4326",
        "EPSG:4978",
        "EPSG:4936",
        "EPSG:7789",
        "EPSG:4807",
        "IGNF:LAMB1",
        "EPSG:31370",
        "GeoC",
        "LEuc*4201661*177860*4779236*0.1*-0.2*2.5",
    ],
)
def test_round_trips_close(definition) -> None:
    """Also for EPSG:31370, whose datum shift PROJ inverts to 0.2 mm only."""
    system = parse(definition)
    place = np.deg2rad([[2.5, 49.0], [4.4, 50.8], [2.9, 50.1]])
    ground = parse("Geog").to_geocentric(np.column_stack([np.rad2deg(place), [0.0, 120.0, 4810.0]]))
    assert system.to_geocentric(system.from_geocentric(ground)) == pytest.approx(ground, abs=1e-8, rel=0)


def test_etrs_89_systems_agree() -> None:
    """Three ways to say the same coordinates."""
    point = np.array([[652000.0, 6862000.0, 35.0]])
    expected = parse("IGNF:LAMB93").to_geocentric(point)
    assert parse("EPSG:2154").to_geocentric(point) == pytest.approx(expected, abs=1e-8, rel=0)
    in_utm = Transformer(parse("EPSG:2154"), parse("EPSG:32631")).forward(point)
    assert parse("EPSG:32631").to_geocentric(in_utm) == pytest.approx(expected, abs=1e-7, rel=0)


def test_heights_stand_on_the_ellipsoid_of_the_system() -> None:
    """NTF: (-168, -60, 320) m from its geocentric axes, on Clarke 1880 (EPSG operation 1193)."""
    a, b = 6378249.2, 6356515.0
    lon, lat, height = np.deg2rad(2.0 + 2.33722917), np.deg2rad(48.0), 100.0
    e2 = 1.0 - (b / a) ** 2
    n = a / np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
    own = [
        (n + height) * np.cos(lat) * np.cos(lon),
        (n + height) * np.cos(lat) * np.sin(lon),
        (n * (1 - e2) + height) * np.sin(lat),
    ]
    given = [2.0 / 0.9, 48.0 / 0.9, height]  # EPSG:4807 is in grads from the meridian of Paris
    found = parse("EPSG:4807").to_geocentric(given)
    assert found == pytest.approx(np.array(own) + np.array([-168.0, -60.0, 320.0]), abs=0.01, rel=0)


def test_euler_angles_of_leuc() -> None:
    system = parse("LEuc*10*20*30*0.1*-0.2*2.5")
    rotation, translation = system.geocentric_pose()
    expected = geometry.rotation_x(0.1) @ geometry.rotation_y(-0.2) @ geometry.rotation_z(2.5)
    assert rotation == pytest.approx(expected, abs=1e-15)
    assert system.to_geocentric([1.0, 2.0, 3.0]) == pytest.approx(expected @ [1, 2, 3] + [10, 20, 30])
    assert translation == pytest.approx([10.0, 20.0, 30.0])


def test_pose_of_projected_systems_is_refused() -> None:
    with pytest.raises(CrsError, match="'IGNF:LAMB93' has no rotation and translation"):
        parse("L93").geocentric_pose()


def test_local_systems_convert_to_themselves_only() -> None:
    same = Transformer(parse("LocalA"), parse("LocalA"))
    points = np.array([[1.0, 2.0, 3.0]])
    assert same.forward(points) == pytest.approx(points, abs=0.0)
    assert same.forward(points) is not points
    for pair in [("LocalA", "LocalB"), ("LocalA", "L93"), ("L93", "LocalA")]:
        with pytest.raises(CrsError, match="converts to itself only"):
            Transformer(*map(parse, pair))
    with pytest.raises(CrsError, match="no origin yet"):
        Transformer(parse("RTL"), parse("RTL"))


def test_a_missing_grid_is_named() -> None:
    system = parse("+proj=utm +zone=31 +ellps=intl +nadgrids=no_such_grid.gsb")
    with pytest.raises(CrsError, match=r"needs a grid that is not installed: no_such_grid\.gsb\. Install it"):
        system.to_geocentric([500000.0, 5000000.0, 0.0])


def test_a_height_above_the_geoid_needs_its_grid() -> None:
    with pytest.raises(CrsError, match=r"needs a grid that is not installed: no_such_geoid\.gtx"):
        parse("RTL*2*48*0*+proj=latlong +datum=WGS84 +geoidgrids=no_such_geoid.gtx")


def test_a_known_vertical_system_is_never_taken_for_ellipsoidal() -> None:
    """Lambert 93 + NGF-IGN69: with its grid, heights rise by the geoid's 40 to 50 m; else an error."""
    system, point = parse("EPSG:5698"), [657700.0, 6860700.0, 100.0]
    try:
        height = system.geodetic(point)[2]
    except CrsError as error:
        assert "fr_ign_RA" in str(error)
    else:
        assert 140.0 < height < 150.0


def test_a_better_transformation_without_its_grid_is_not_replaced_by_a_worse_one() -> None:
    system = parse("EPSG:31468")  # DHDN: BETA2007 to 0.5 m, else 3 m
    try:
        accuracy = system.operation.accuracy
    except CrsError as error:
        assert "de_adv_BETA2007" in str(error)
    else:
        assert accuracy < 1.0


@pytest.mark.parametrize("definition", ["+proj=utm +zone=31 +ellps=intl", "EPSG:2218"])
def test_a_ballpark_transformation_is_refused(definition) -> None:
    with pytest.raises(CrsError, match=r"no transformation .* but a ballpark one"):
        parse(definition).to_geocentric([500000.0, 5000000.0, 0.0])


def test_points_outside_the_domain_are_named() -> None:
    points = np.array([[2.0, 48.0, 0.0], [2.0, 95.0, 0.0], [np.nan, 48.0, 0.0]])
    with pytest.raises(CrsError, match=r"Point T4 \(2, 95, 0\) is outside the domain of 'EPSG:4326'.*1 more"):
        parse("EPSG:4326").to_geocentric(points, names=["S1", "T4", "T5"])
    with pytest.raises(CrsError, match=r"The point of index 1 \(2, 95, 0\)"):
        Transformer(parse("EPSG:4326"), parse("GeoC")).forward(points)
    with pytest.raises(CrsError, match=r"Point S1 \(nan, 0, 0\) has no finite coordinates"):
        parse(PARIS).to_geocentric([[np.nan, 0.0, 0.0]], names=["S1"])
    with pytest.raises(CrsError, match=r"Point S1 .*has no finite coordinates"):
        parse(PARIS).from_geocentric([[np.inf, 0.0, 0.0]], names=["S1"])
    with pytest.raises(CrsError, match=r"Point S1 .*\(geocentric\) is outside the domain"):
        parse("L93").from_geocentric([[np.nan, 0.0, 0.0]], names=["S1"])


def test_shapes() -> None:
    points = np.random.default_rng(5).uniform(-100.0, 100.0, (4, 5, 3))
    there = Transformer(parse(PARIS), parse("L93"))
    assert there.forward(points).shape == (4, 5, 3)
    assert there.forward(points[1, 2]) == pytest.approx(there.forward(points)[1, 2], abs=0.0)
    assert there.forward(np.empty((0, 3))).shape == (0, 3)
    with pytest.raises(CrsError, match=r"three coordinates.*\(4, 2\)"):
        there.forward(np.zeros((4, 2)))


def test_accuracy_is_told() -> None:
    system = parse("IGNF:LAMB93")
    assert isinstance(system, ProjSystem)
    assert system.operation.accuracy == pytest.approx(1.0)
    assert "WGS 84" in system.operation.description


def test_inverse_is_exact_at_any_height() -> None:
    """PROJ's own inverse is off by a micrometre at 9 km, and by a quarter of a metre at 20 000 km."""
    ground = np.array([[2.5, lat, height] for lat in (-60.0, 1.0, 45.0) for height in (-1e4, 0, 9e3, 2e7)])
    back = parse("Geog").from_geocentric(parse("Geog").to_geocentric(ground))
    assert back[:, 2] == pytest.approx(ground[:, 2], abs=2e-8, rel=0)
    assert back[:, :2] == pytest.approx(ground[:, :2], abs=1e-13, rel=0)


@pytest.mark.slow
def test_many_points_at_once() -> None:
    points = np.random.default_rng(6).uniform(-5000.0, 5000.0, (20_000, 3))
    there = Transformer(parse(PARIS), parse("L93"))
    np.testing.assert_allclose(there.inverse(there.forward(points)), points, rtol=0.0, atol=1e-7)
    assert crs.parse(PARIS).vertical_rotation(points).shape == (20_000, 3, 3)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_given_coordinates_stay_as_they_are(n) -> None:
    given = np.array([[652709.0, 6861100.0, 35.0], [652709.0, 6861200.0, 36.0]])[:n]
    before = given.copy()
    there = Transformer(parse("L93"), parse("GeoC")).forward(given)
    assert there.shape == (n, 3)
    geocentric = there.copy()
    back = Transformer(parse("GeoC"), parse("L93")).forward(there)
    np.testing.assert_array_equal(given, before)
    np.testing.assert_array_equal(there, geocentric)
    np.testing.assert_allclose(back, before, atol=1e-8)
