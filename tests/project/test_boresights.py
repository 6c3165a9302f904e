"""Clinometers as they were before blocks: `ClinoInit`, and `ClinoDirIn` of a bundle adjustment."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Pendulum, Poses
from obseq.project.cameras import orientation_files
from obseq.project.contents import contents
from obseq.project.instruments.blocks import ClinometerReadings
from obseq.project.instruments.boresights import (
    PENDULUM,
    SPRING,
    axes_of,
    found_boresights,
    read_boresights,
)
from obseq.project.layout import ProjectTree

DOWN = np.array([0.0, 0.0, -1.0])
NOISE = 2e-4
RNG = np.random.default_rng(5)
TRUE = Rotation.from_rotvec([0.4, -0.7, 1.1]).as_matrix()
CAMERA = Camera("cam", 4000, 3000, focal=2500.0)
LEVEL = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def _poses(n: int) -> Poses:
    turns = [LEVEL @ Rotation.from_rotvec(RNG.normal(0, 0.25, 3)).as_matrix() for _ in range(n)]
    return Poses.of(
        [f"I_{k:03d}.jpg" for k in range(n)], RNG.normal(0, 1, (n, 3)), turns, cameras=["cam"] * n
    )


def _angles(poses: Poses, boresight: np.ndarray, kind: str) -> np.ndarray:
    seen = np.array([boresight @ turn.T @ DOWN for turn in poses.rotations])
    exact = np.arcsin(seen[:, 1]) if kind == SPRING else np.arctan2(seen[:, 1], seen[:, 0])
    return exact + RNG.normal(0, NOISE, len(seen))


def _readings(poses: Poses, kinds: dict[str, np.ndarray], kind: str) -> ClinometerReadings:
    angles = np.column_stack([_angles(poses, boresight, kind) for boresight in kinds.values()])
    exposures = tuple(name[2:5] for name in poses.images)
    return ClinometerReadings(Path("tilts"), tuple(kinds), exposures, angles, np.full(angles.shape, NOISE))


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(Rotation.from_matrix(a @ b.T).magnitude())


@pytest.mark.parametrize("kind", [SPRING, PENDULUM])
def test_two_clinometers_are_found_together(kind) -> None:
    poses, second = _poses(12), axes_of("i-kj")
    readings = _readings(poses, {"A": TRUE, "B": second @ TRUE}, kind)
    found = found_boresights(readings, poses, [0, 1], kind)
    first, other = found.boresights
    assert _angle(first.rotation, TRUE) < 5 * NOISE and _angle(other.rotation, second @ TRUE) < 5 * NOISE
    assert (other.reference, other.kind, first.camera) == ("A", kind, "cam")
    np.testing.assert_array_equal(other.relative, second)
    sigma = float(found.lines[0].split("sigma ")[1].split()[0])
    assert 0.6 * NOISE < sigma < 1.5 * NOISE and len(found.lines) == 4


def test_a_spring_alone_has_an_axis_and_a_pendulum_alone_a_boresight() -> None:
    poses = _poses(12)
    (spring,) = found_boresights(_readings(poses, {"A": TRUE}, SPRING), poses, [0]).boresights
    assert np.arccos(spring.rotation[1] @ TRUE[1]) < 5 * NOISE
    (pendulum,) = found_boresights(_readings(poses, {"A": TRUE}, PENDULUM), poses, [0], PENDULUM).boresights
    assert _angle(pendulum.rotation, TRUE) < 8 * NOISE


def test_the_original_bench_keeps_its_boresights() -> None:
    """`BenchClinoBa`: axes j, -k, -i and i, -k, j of that; poses turned by 0.05 about y and x."""
    first = axes_of("j-k-i")
    second = axes_of("i-kj") @ first
    poses = Poses.of(
        ["1", "2", "3"],
        np.zeros((3, 3)),
        [np.eye(3), exponential([0.0, 0.05, 0.0]), exponential([0.05, 0.0, 0.0])],
        cameras=["cam"] * 3,
    )
    block = BundleAdjustment()
    block.add_cameras(CAMERA)
    block.add_poses(poses)
    block.freeze_centres(".*")
    block.freeze_rotations(".*")
    block.freeze_parameters(".*")
    points = np.array([[0.1, 0.2, 4.0], [-0.3, 0.1, 5.0], [0.2, -0.3, 6.0]])
    block.add_control_points(ControlPoints.of(["a", "b", "c"], points, 0.01))
    for name, turn in zip(poses.images, poses.rotations, strict=True):
        block.add_measures(ImagePoints.of([name] * 3, ["a", "b", "c"], CAMERA.project(points @ turn), 1.0))
    for name, boresight, angles in (("C1", first, (0.0, 0.05, 0.0)), ("C2", second, (0.0, 0.0, 0.05))):
        block.add_pendulum(Pendulum(name, boresight, turns_with="C1" if name == "C2" else ""))
        block.add_needles(name, poses.images, angles, 1e-3)
    solution = block.solve()
    assert solution.converged and np.abs(solution.needle_residuals()).max() < 1e-9
    for name, boresight in (("C1", first), ("C2", second)):
        np.testing.assert_allclose(solution.pendulum(name).boresight, boresight, atol=1e-8)


def test_what_does_not_determine_a_boresight_is_told() -> None:
    poses = _poses(5)
    alike = Poses.of(poses.images, poses.centres, [LEVEL] * 5, cameras=["cam"] * 5)
    with pytest.raises(InputError, match="tilted alike"):
        found_boresights(_readings(alike, {"A": TRUE}, PENDULUM), alike, [0], PENDULUM)
    with pytest.raises(InputError, match="2 exposures have an image"):
        found_boresights(_readings(poses, {"A": TRUE}, SPRING), poses.select(poses.images[:2]), [0])
    with pytest.raises(InputError, match="numbers of its clinometers are wanted: 0 A"):
        found_boresights(_readings(poses, {"A": TRUE}, SPRING), poses, [1])
    with pytest.raises(InputError, match="'i-ik' is no right-handed frame"):
        axes_of("i-ik")
    with pytest.raises(InputError, match="its boresight is a rotation matrix"):
        Pendulum("A", 2.0 * np.eye(3))


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A project with poses, control points, measures and readings of two clinometers of a kind, as typed."""
    monkeypatch.chdir(tmp_path)

    def made(kind: str) -> Poses:
        poses = _poses(12)
        targets = {f"T{k}": place for k, place in enumerate(RNG.uniform([-4, 8, -3], [4, 14, 3], (12, 3)))}
        tree = ProjectTree.at(tmp_path, is_new=True)
        files = orientation_files(tree.folder("Ori", "BA"), poses, {"cam": CAMERA})
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        lines = [f"{name} {x} {y} {z}" for name, (x, y, z) in targets.items()]
        Path("p.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        assert main(["mmvii", "ImportGCP", "p.txt", "NXYZ", "T", "Sigma=0.001", "ChSys=[LocalS]"]) == 0
        for image, centre, turn in zip(poses.images, poses.centres, poses.rotations, strict=True):
            local = (np.array(list(targets.values())) - centre) @ turn
            seen = CAMERA.project(local) + RNG.normal(0, 0.3, (len(local), 2))
            inside = (local[:, 2] > 1.0) & (seen > 0).all(axis=1) & (seen < [4000, 3000]).all(axis=1)
            rows = "".join(
                f'<el><Name>"{name}"</Name><Pt>{x} {y}</Pt><Sigma2>0.09 0 0.09</Sigma2></el>'
                for name, (x, y), used in zip(targets, seen.tolist(), inside, strict=True)
                if used
            )
            text = (
                '<?xml version="1.0"?><Root><Type>"MMVII_Serialization"</Type><Version>"0.0.0"</Version>'
                f'<Data><SetMesIm><NameIm>"{image}"</NameIm><Measures>{rows}</Measures></SetMesIm></Data></Root>'
            )
            path = tree.folder("ObjMesInstr", "T") / f"MesIm-{image}.xml"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        readings = _readings(poses, {"A": TRUE, "B": axes_of("i-kj") @ TRUE}, kind)
        rows = [
            f"{exposure} {a:.7f} {NOISE} {b:.7f} {NOISE}"
            for exposure, (a, b) in zip(readings.exposures, readings.angles.tolist(), strict=True)
        ]
        Path("tilts.txt").write_text("\n".join(rows) + "\n", encoding="utf-8")
        return poses

    return made


@pytest.mark.parametrize("kind", [SPRING, PENDULUM])
def test_from_readings_to_the_adjusted_block_as_typed(site, kind, capsys) -> None:
    site(kind)
    assert main(["mmvii", "ImportMeasuresClino", "tilts.txt", "ImASAS", "Tilts"]) == 0
    assert main(["mmvii", "ClinoInit", "Tilts", "[0,1]", "BA", "First", f"Type={kind}", "DMGon=1"]) == 0
    printed = capsys.readouterr()
    assert "turn between them: off by" in printed.out and "DMGon has no effect here" in printed.err
    files = sorted(path.name for path in Path("MMVII-PhgrProj/Clino/First").iterdir())
    assert files == ["ClinoCalib-0-cam.xml", "ClinoCalib-1-cam.xml"]
    words = ["OriBundleAdj", ".*jpg", "BA", "Out", "GCP3D=[[T,1]]", "GCP2D=[[T,0.3]]", "PPFzCal=.*"]
    plain = main(["mmvii", *words])
    assert plain == 0, capsys.readouterr()
    clino = ["ClinoDirIn=First", "InMeasureClino=Tilts", "ClinoDirOut=Last"]
    capsys.readouterr()
    assert main(["mmvii", *words, *clino]) == 0
    assert "RelCalib of a spring" in capsys.readouterr().out or kind == PENDULUM
    first, second = read_boresights(Path("MMVII-PhgrProj/Clino/Last"))
    for one, true in ((first, TRUE), (second, axes_of("i-kj") @ TRUE)):
        if kind == PENDULUM:
            assert _angle(one.rotation, true) < 5 * NOISE
        else:
            assert np.arccos(one.rotation[1] @ true[1]) < 5 * NOISE
            assert np.linalg.det(one.rotation) == pytest.approx(1.0)
    np.testing.assert_array_equal(second.relative, axes_of("i-kj"))
    known = {item.path.name: item for item in contents(ProjectTree.at("."))}
    assert (known["ClinoCalib-0-cam.xml"].kind, known["ClinoCalib-0-cam.xml"].unknown) == ("clinometer", ())


def test_what_is_missing_is_told(site, capsys) -> None:
    site(SPRING)
    assert main(["mmvii", "ImportMeasuresClino", "tilts.txt", "ImASAS", "Tilts"]) == 0
    words = ["mmvii", "OriBundleAdj", ".*jpg", "BA", "Out", "GCP3D=[[T,1]]", "GCP2D=[[T,0.3]]"]
    for given, said in (
        (["ClinoDirOut=B"], "ClinoDirOut has no effect without ClinoDirIn"),
        (["ClinoDirIn=None", "InMeasureClino=Tilts"], "holds no clinometers (ClinoCalib-"),
    ):
        assert main([*words, *given]) == 2
        assert said in capsys.readouterr().err
    Path("tilts.txt").write_text(Path("tilts.txt").read_text() + "999 0.1 1e-4 0.2 1e-4\n")
    assert main(["mmvii", "ImportMeasuresClino", "tilts.txt", "ImASAS", "Tilts"]) == 0
    assert main(["mmvii", "ClinoInit", "Tilts", "[0]", "BA", "First"]) == 2
    assert "exposure 999 has no image with a pose" in capsys.readouterr().err
    assert main(["mmvii", "ClinoInit", "Tilts", "[0]", "BA", "First", "OkNoCam=1"]) == 0
    assert "does not say how it is turned about its y axis" in capsys.readouterr().out
