"""GNSS vectors as GVX: a triangle with its covariances gives its coordinates; what is wrong is told."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network

PLACES = {
    "A": (4_200_000.0, 170_000.0, 4_780_000.0),
    "B": (4_199_500.0, 171_200.0, 4_780_350.0),
    "C": (4_200_700.0, 170_900.0, 4_779_300.0),
}
SIGMAS, CORRELATIONS = (0.004, 0.003, 0.005), (0.3, -0.2, 0.4)


def point(number, name, xyz, system="126"):
    coordinates = "".join(f"<{axis}>{value:.4f}</{axis}>" for axis, value in zip("XYZ", xyz, strict=True))
    return (
        f"<POINT><ID>{number}</ID><NAME>{name}</NAME><COORDINATES>"
        f"<REFERENCE_SYSTEM_ID>{system}</REFERENCE_SYSTEM_ID><EPOCH>2010.0</EPOCH>"
        f"<GEOCENTRIC_COORDINATES>{coordinates}</GEOCENTRIC_COORDINATES></COORDINATES></POINT>\n"
    )


def vector(number, start, end, deltas, correlations=CORRELATIONS):
    parts = [
        *zip(("DX", "DY", "DZ"), deltas, strict=True),
        *zip(("SDX", "SDY", "SDZ", "PXY", "PXZ", "PYZ"), (*SIGMAS, *correlations), strict=True),
    ]
    texts = [f"<{name}>{value:.4f}</{name}>" for name, value in parts]
    return (
        f"<GNSS_VECTOR><ID>{number}</ID><INITIAL_POINT_ID>{start}</INITIAL_POINT_ID>"
        f"<TERMINAL_POINT_ID>{end}</TERMINAL_POINT_ID><ECEF_DELTAS>{''.join(texts[:3])}</ECEF_DELTAS>"
        f"<CORRELATION_MATRIX>{''.join(texts[3:])}</CORRELATION_MATRIX></GNSS_VECTOR>\n"
    )


def text(**changed):
    """The second occupation of B has an identifier of its own, and its name."""
    points = [point(1, "A", PLACES["A"]), point(2, "B", PLACES["B"]), point(3, "C", PLACES["C"])]
    points.append(point(4, "B", np.add(PLACES["B"], 1.0)))
    ends = ((1, 2, "A", "B"), (1, 3, "A", "C"), (4, 3, "B", "C"))
    vectors = [
        vector(n, a, b, np.subtract(PLACES[q], PLACES[p]) + 0.001 * np.array([n, -n, 2 - n]))
        for n, (a, b, p, q) in enumerate(ends)
    ]
    found = (
        '<?xml version="1.0"?>\n<GVX VERSION="1.0"><REFERENCE_SYSTEM><ID>126</ID><NAME>NAD83(2011)</NAME>'
        "<LINEAR_UNIT><NAME>metre</NAME></LINEAR_UNIT></REFERENCE_SYSTEM>\n"
        f"{''.join(points)}{''.join(vectors)}</GVX>\n"
    )
    for old, new in changed.values():
        assert old in found
        found = found.replace(old, new, 1)
    return found


def test_a_triangle_of_vectors(tmp_path):
    """Least squares of three vectors of one covariance: each takes a third of the misclosure."""
    (tmp_path / "a.gvx").write_text(text())
    network = Network.read_project(tmp_path / "a.gvx")
    places = network.points_crs.from_geocentric(np.array([PLACES["A"]]))[0]
    (tmp_path / "k.cor").write_text(f"1 A {places[0]:.12f} {places[1]:.12f} {places[2]:.6f} 0.0001\n")
    known = Network.read_project(tmp_path / "a.gvx", point_files=tmp_path / "k.cor")
    adjusted = known.adjust()
    rows = adjusted.record().points
    found = known.points_crs.to_geocentric(np.array([(p.crs_x, p.crs_y, p.crs_z) for p in rows]))
    at = {row.name: place for row, place in zip(rows, found, strict=True)}
    measured = {
        n: np.subtract(PLACES[q], PLACES[p]) + 0.001 * np.array([n, -n, 2 - n])
        for n, (p, q) in enumerate((("A", "B"), ("A", "C"), ("B", "C")))
    }
    misclosure = measured[0] + measured[2] - measured[1]
    np.testing.assert_allclose(at["B"] - at["A"], measured[0] - misclosure / 3, atol=2e-6)
    np.testing.assert_allclose(at["C"] - at["A"], measured[1] + misclosure / 3, atol=2e-6)
    (cluster, *_) = known.book.clusters
    np.testing.assert_allclose(np.sqrt(np.diag(cluster.covariance)), SIGMAS)
    assert cluster.covariance[0, 2] == pytest.approx(-0.2 * 0.004 * 0.005)
    assert adjusted.record().redundancy == 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("<TERMINAL_POINT_ID>2<", "<TERMINAL_POINT_ID>9<"), "TERMINAL_POINT_ID '9' is no POINT"),
        (("<PXY>0.3", "<PXY>1.3"), "not positive definite"),
        (("<NAME>metre<", "<NAME>US survey foot<"), "only metres are read"),
        (("<NAME>NAD83(2011)<", "<NAME>Atlantis 1<"), "reference frame 'Atlantis 1' is not known"),
        (("_SYSTEM_ID>126<", "_SYSTEM_ID>153<"), "points are in 2 reference systems"),
        (("<DX>", "<DU>0</DU><DX>x"), "DX: 'x-?[0-9.]+' is not a number"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, change, message):
    (tmp_path / "a.gvx").write_text(text(change=change))
    with pytest.raises(InputError, match=message):
        Network.read_project(tmp_path / "a.gvx")


def read(tmp_path, *changes, more=""):
    found = text()
    for old, new in changes:
        assert old in found
        found = found.replace(old, new)
    (tmp_path / "a.gvx").write_text(found.replace("</GVX>", more + "</GVX>"))
    return Network.read_project(tmp_path / "a.gvx")


def test_points_may_be_in_degrees_and_vectors_within_their_quality(tmp_path):
    """As the schema allows, and as the writer of the NGS has it."""
    plain = read(tmp_path)
    network = read(
        tmp_path,
        ("<GEOCENTRIC_COORDINATES>", "<GEODETIC_COORDINATES><!--"),
        (
            "</GEOCENTRIC_COORDINATES>",
            "--><LATITUDE>48.8</LATITUDE><LONGITUDE>2.3</LONGITUDE>"
            "<ELLIPSOIDAL_HEIGHT>90</ELLIPSOIDAL_HEIGHT></GEODETIC_COORDINATES>",
        ),
        ("<ECEF_DELTAS>", "<QUALITY_CONTROL><ECEF_DELTAS>"),
        ("</CORRELATION_MATRIX>", "</CORRELATION_MATRIX></QUALITY_CONTROL>"),
    )
    place = network.given_points().coordinates[0]
    np.testing.assert_allclose(place, (2.3, 48.8, 90.0), atol=1e-6)
    np.testing.assert_allclose(network.book.observations.values, plain.book.observations.values)


CROSSED = """<SESSION ID="1" TOTAL_VECTORS="2"><CROSS_CORRELATION_MATRIX ORDER="XYZ">
<CCM_BLOCK VECTOR_ID_ROW="0" VECTOR_ID_COL="2">
<CORRELATIONS>.1,.2,.3,.4,.1,.2,.3,.4,.1</CORRELATIONS></CCM_BLOCK>
</CROSS_CORRELATION_MATRIX></SESSION>"""


def test_vectors_of_a_session_are_correlated(tmp_path):
    network = read(tmp_path, more=CROSSED)
    together, alone = network.book.clusters
    assert (together.covariance.shape, alone.covariance.shape) == ((6, 6), (3, 3))
    assert together.covariance[0, 4] == pytest.approx(0.2 * SIGMAS[0] * SIGMAS[1])
    assert together.covariance[1, 3] == pytest.approx(0.4 * SIGMAS[1] * SIGMAS[0])
    with pytest.raises(InputError, match="nine correlations"):
        read(tmp_path, more=CROSSED.replace(".1,.2", ".1"))
    with pytest.raises(InputError, match="no other session"):
        read(tmp_path, more=CROSSED.replace('COL="2"', 'COL="7"'))
