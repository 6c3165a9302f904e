"""Projection matrices of Pix4D: interiors and poses of them, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from obseq.errors import InputError
from obseq.formats.pix4d.reader import read_pix4d

K = np.array([[3000.0, 0.0, 2000.0], [0.0, 3000.0, 1500.0], [0.0, 0.0, 1.0]])
TURNS = Rotation.from_euler("xyz", [[178, 2, 30], [181, -1, 80], [175, 3, -20]], degrees=True).as_matrix()
CENTRES = np.array([[10.0, 20.0, 100.0], [60.0, 25.0, 103.0], [15.0, 70.0, 98.0]])


def written(folder, interiors, scale=1.0):
    lines = []
    for name, k, turn, centre in zip(("a b.jpg", "c.jpg", "d.jpg"), interiors, TURNS, CENTRES, strict=True):
        matrix = scale * k @ turn.T @ np.column_stack([np.eye(3), -centre])
        lines.append(" ".join([name, *(f"{number:.12f}" for number in matrix.ravel())]))
    (folder / "block_pmatrix.txt").write_text("\n".join([*lines, ""]))
    return folder / "block_pmatrix.txt"


@pytest.mark.parametrize("scale", [1.0, -2.0])
def test_a_matrix_is_taken_apart(tmp_path, scale):
    other = K + np.diag([200.0, 200.0, 0.0])
    block = read_pix4d(written(tmp_path, [K, other, K], scale))
    assert block.poses.images == ("a b.jpg", "c.jpg", "d.jpg")
    np.testing.assert_allclose(block.poses.centres, CENTRES, atol=1e-6)
    np.testing.assert_allclose(block.poses.rotations, TURNS, atol=1e-9)
    assert [block.camera_of[name] for name in block.poses.images] == ["camera 1", "camera 2", "camera 1"]
    point = np.array([[20.0, 30.0, 2.0]])
    camera = block.cameras["camera 2"]
    x = other @ TURNS[1].T @ (point[0] - CENTRES[1])
    np.testing.assert_allclose(camera.project((point - CENTRES[1]) @ TURNS[1])[0], x[:2] / x[2], atol=1e-5)
    assert any("without distortion" in note for note in block.notes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda k: k + np.diag([30.0, 0.0, 0.0]), "one focal length"),
        (lambda k: k * 0.0, "has an inverse"),
        (lambda k: k * np.nan, "12 finite numbers"),
    ],
)
def test_matrices_that_are_no_camera_of_ours_are_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=r"block_pmatrix\.txt:2: ") as caught:
        read_pix4d(written(tmp_path, [K, change(K), K]))
    assert message in str(caught.value)
