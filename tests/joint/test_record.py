"""The record of an open adjustment: as that of `adjust`, with all points, and observations of any formula."""

import numpy as np
import pytest

import obseq
from obseq.images import BundleAdjustment, Camera, ImagePoints
from obseq.survey import Network

CAMERA = Camera("wide", 4000, 3000, focal=2500.0)
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture
def mini(shared_data) -> Network:
    folder = shared_data / "mmvii-topomini"
    system = "IGNF:LAMB93"
    return Network.read(
        folder / "meas.obs",
        folder / "coords.txt",
        frame=f"RTL*657700*6860700*0*{system}",
        points_crs=system,
        point_sigma=0.001,
    )


def test_a_network_alone_has_the_record_of_adjust(mini) -> None:
    own, solution = mini.adjust(), obseq.Adjustment.of(mini).solve()
    for found in (solution.record(), solution.survey().record()):
        record = own.record()
        for name in ("observations", "stations", "constraints", "setups", "types"):
            theirs, ours = getattr(record, name), getattr(found, name)
            assert len(theirs) == len(ours)
            for a, b in zip(theirs, ours, strict=True):
                assert _rounded(a.__struct_fields__, a) == _rounded(a.__struct_fields__, b), name
        for a, b in zip(record.points, found.points, strict=True):
            assert (a.name, a.known) == (b.name, b.known)
            assert (a.x, a.sz, a.crs_y) == pytest.approx((b.x, b.sz, b.crs_y), abs=1e-9)
            assert a.ellipse.semi_major == pytest.approx(b.ellipse.semi_major, rel=1e-6)
    assert found.sigma0 == pytest.approx(own.solution.variance_factor**0.5)
    assert found.reliability.tests == record.reliability.tests


def _rounded(fields, one):
    values = [getattr(one, name) for name in fields]
    return [
        f"{value:.4e}" if isinstance(value, float) and abs(value) > 1e-9 else value
        for value in values
        if not (isinstance(value, float) and abs(value) <= 1e-9)
    ]


def test_points_and_observations_of_ones_own_are_in_it(mini, tmp_path) -> None:
    site = obseq.Adjustment.of(mini)
    site.add_points(["Q"], [[5.0, 5.0, 10.0]], 0.01)
    places = mini.adjust().points
    ends = places.coordinates[[places.names.index(name) for name in ("PtA", "PtB", "PtC")]]
    lengths = np.round(np.linalg.norm(ends - [5.0, 5.0, 10.0], axis=1), 3).tolist()
    site.add("Dist3D", p1="Q", p2=["PtA", "PtB", "PtC"], distance=lengths, sigma=0.004)
    solution = site.solve()
    record = solution.record("Site")
    (point,) = [one for one in record.points if one.name == "Q"]
    assert point.known == "xyz" and 0.0 < point.sx < 0.02
    (there,) = mini.point_system.coordinates(np.array([[point.x, point.y, point.z]]))
    np.testing.assert_allclose([point.crs_x, point.crs_y, point.crs_z], there, atol=1e-6)
    assert [one.coordinate for one in record.constraints if one.point == "Q"] == ["x", "y", "z"]
    rows = [one for one in record.observations if one.type == "Dist3D"]
    assert [(one.origin, one.target, one.value) for one in rows] == [
        ("Q", "PtA", lengths[0]),
        ("Q", "PtB", lengths[1]),
        ("Q", "PtC", lengths[2]),
    ]
    for one in rows:
        at = solution.points([one.origin, one.target])
        assert one.residual == pytest.approx(np.linalg.norm(at[0] - at[1]) - one.value, abs=1e-9)
        assert one.unit == "m" and 0.0 < one.redundancy < 1.0 and one.detectable > one.sigma
    assert {"Dist3D", "known values", "Dist"} <= {one.name for one in record.types}
    total = sum(one.redundancy for one in record.observations) + sum(
        one.redundancy for one in record.constraints
    )
    assert total == pytest.approx(record.redundancy)
    for ending in ("json", "html", "txt"):
        solution.save(tmp_path / f"site.{ending}")
    assert obseq.load(tmp_path / "site.json").table("observations")["type"].count("Dist3D") == 3
    assert "Dist3D" in (tmp_path / "site.txt").read_text(encoding="utf-8")


def test_what_was_measured_is_the_reading_not_its_correction() -> None:
    """A zenith angle falls with its refraction as with its reading; a cosine over a length is no length."""
    site = obseq.Adjustment()
    site.add_points(["S", "T", "O"], [[0.0, 0, 0], [30, 0, 40], [9, 9, 0]], 0.001)
    site.add_rotations(["S"], [np.eye(3)])
    site.add_directions(["vertical"], [[0.0, 0, 1]])
    site.hold("S", "Rotation")
    site.hold("vertical", "Direction")
    zenith = np.arctan2(30, 40) - 2e-5
    site.add("TopoZen", station="S", target="T", refraction=2e-5, zenith=zenith, sigma=1e-5)
    site.add("AxisLink", axis="vertical", origin="S", point="O", distance=12.7, sigma=1e-4)
    record = site.solve().record()
    (row,) = record.observations
    assert (row.type, row.unit, row.value) == ("TopoZen", "rad", zenith)
    assert row.adjusted == pytest.approx(zenith, abs=1e-9)
    assert any("AxisLink" in note for note in record.notes)


def _figure(tmp_path, wrong: str = "", images: bool = False) -> obseq.Adjustment:
    """A network of four known and two free points with one line replaced; two images of it, if asked for."""
    rng = np.random.default_rng(4)
    at = {
        "A": [0, 0, 0],
        "B": [40, 0, 1],
        "C": [40, 30, 3],
        "D": [0, 30, 2],
        "P": [20, 14, 8],
        "Q": [17, 18, 5],
    }
    lines = []
    for origin in "ABCD":
        lines.append("#VERT")
        for target in [name for name in at if name != origin]:
            gap = np.subtract(at[target], at[origin])
            hz, zenith = np.arctan2(gap[0], gap[1]), np.arctan2(np.hypot(*gap[:2]), gap[2])
            for code, value, sigma in ((5, hz, 5e-4), (6, zenith, 5e-4)):
                reading = value * 200 / np.pi % 400 + rng.normal(0, sigma)
                lines.append(f"{code} {origin} {target} {reading:.5f} {sigma}")
            lines.append(f"3 {origin} {target} {np.linalg.norm(gap) + rng.normal(0, 0.001):.4f} 0.001")
    start = " ".join(wrong.split()[:3])
    lines = [wrong if wrong and line.startswith(start + " ") else line for line in lines]
    (tmp_path / "f.obs").write_text("\n".join(lines) + "\n", encoding="utf-8")
    points = [f"{int(name in 'ABCD')} {name} {x} {y} {z} 0.001 0.001 0.001" for name, (x, y, z) in at.items()]
    (tmp_path / "f.cor").write_text("\n".join(points) + "\n", encoding="utf-8")
    site = obseq.Adjustment.of(Network.read(tmp_path / "f.obs", tmp_path / "f.cor"))
    if images:
        block = BundleAdjustment()
        block.add_cameras(CAMERA)
        centres = np.array([[10.0, -60, 5], [30, -60, 6]])
        block.add_poses(["i0", "i1"], centres, [UPRIGHT, UPRIGHT])
        block.freeze_parameters(".*")
        for name, centre in zip(("i0", "i1"), centres, strict=True):
            local = (np.array(list(at.values())) - centre) @ UPRIGHT
            pixels = CAMERA.project(local) + rng.normal(0, 0.3, (len(at), 2))
            block.add_measures(ImagePoints.of([name] * len(at), list(at), pixels, 0.3))
        site.add_images(block)
    return site


@pytest.mark.parametrize("images", [False, True])
def test_a_wrong_survey_observation_has_the_code_and_the_slip_of_surveys(tmp_path, images) -> None:
    true = np.linalg.norm([20, 14, 8])
    site = _figure(tmp_path, f"3 A P {true + 0.2:.4f} 0.001", images)
    solution = site.solve()
    (accused,) = solution.diagnosis.accused
    assert (accused.code, accused.unit) == ("S100", "m")
    assert accused.what.startswith("Dist A -> P (") and "f.obs:" in accused.what
    assert accused.size[0] == pytest.approx(0.2, abs=0.005)
    assert [slip.code for slip in accused.slips] == ["W109"]  # one digit is wrong
    record = solution.record()
    (place,) = record.diagnosis.accused[0].observations
    row = record.observations[place.row]
    assert (row.type, row.origin, row.target, row.line) == ("Dist", "A", "P", place.line)
    if images:
        block = solution.block()
        assert block.diagnosis.accused[0].code == "S100" and not block.diagnosis.accused[0].observations
        assert {"i0", "i1", "P"} <= {point.name for point in record.points}
        assert len(block.record().images) == 2
        block.save(tmp_path / "block.html")
    solution.save(tmp_path / "site.html")


def test_a_wrong_known_point_has_the_code_of_surveys(tmp_path) -> None:
    _figure(tmp_path)
    text = (tmp_path / "f.cor").read_text(encoding="utf-8").replace("1 B 40 0 1 ", "1 B 40.05 0 1 ")
    (tmp_path / "f.cor").write_text(text, encoding="utf-8")
    solution = obseq.Adjustment.of(Network.read(tmp_path / "f.obs", tmp_path / "f.cor")).solve()
    (accused,) = solution.diagnosis.accused
    assert accused.code == "S110" and accused.what.startswith("known x of B (")
    assert accused.size[0] == pytest.approx(0.05, abs=0.005)


def test_a_distance_is_not_negative_where_points_have_names():
    whole = obseq.Adjustment()
    whole.add_points(["A", "B", "P"], [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    with pytest.raises(obseq.InputError, match=r"Dist3D: a distance is negative \(-1\)"):
        whole.add("Dist3D", p1="P", p2=["A", "B"], distance=[-1.0, 2.0], sigma=0.01)
