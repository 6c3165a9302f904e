"""Draw the pictures of the documentation from real data: `python tools/pictures.py FOLDER_OF_DATA`.

The folder holds the test data of Borea (MIT) and the epipolar cases; the pictures go to docs/pictures.
"""

import json
import sys
from pathlib import Path

import numpy as np

from obseq.images.aerial import (
    Geoid,
    HeightType,
    MapSystem,
    Worksite,
    intersect_rays,
    read_camera,
    read_image_points,
    read_shots,
    read_terrain,
)
from obseq.images.epipolar import Pinhole, epipolar_residuals, fit_field, residual_page

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
ELLIPSES = 400.0
"""How many times larger than life ellipses are drawn."""
SHOWN = 400


def aerial(folder: Path) -> str:
    """Shots of a strip, the points they see, and the error ellipses of those points."""
    cameras = {camera.name: camera for camera in map(read_camera, sorted(folder.glob("Camera?.txt")))}
    shots, _ = read_shots(folder / "23FD1305_alt_2.OPK", interval=(2, None))
    site = Worksite(shots, cameras, MapSystem(2154), Geoid(folder / "fr_ign_RAF20.tif"))
    site = site.with_nadir(read_terrain(folder / "dtm_synth_height.asc", HeightType.HEIGHT))
    measured = read_image_points(folder / "all_liaisons2.mes")
    names = {name: k for k, name in enumerate(dict.fromkeys(measured.names))}
    point = np.array([names[name] for name in measured.names])
    rows = site.rows(measured.shots)
    found = intersect_rays(site, point, rows, measured.pixels, len(names), HeightType.HEIGHT, sigma=0.3)
    assert found.covariances is not None
    good = np.flatnonzero(np.isfinite(found.points).all(axis=1))
    plan = found.points[good, :2]
    near = good[np.argsort(((plan - np.median(plan, axis=0)) ** 2).sum(axis=1))[:SHOWN]]
    stations = shots.positions[np.unique(rows[np.isin(point, near)]), :2]
    return plan_svg(found.points[near, :2], found.covariances[near, :2, :2], stations)


def plan_svg(points: np.ndarray, covariances: np.ndarray, stations: np.ndarray) -> str:
    """A plan with north up: ellipses of points, crosses of stations."""
    low = np.vstack([points, stations]).min(axis=0) - 100.0
    high = np.vstack([points, stations]).max(axis=0) + 100.0
    width, height = high - low
    parts = []
    for place, covariance in zip(points, covariances, strict=True):
        values, vectors = np.linalg.eigh(covariance)
        turn = -np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        x, y = place[0] - low[0], high[1] - place[1]
        a, b = ELLIPSES * np.sqrt(values[::-1])
        parts.append(
            f"<ellipse rx='{a:.1f}' ry='{b:.1f}' transform='translate({x:.1f} {y:.1f}) rotate({turn:.1f})'/>"
        )
    crosses = "".join(
        f"<path d='M{x - 25:.0f} {y:.0f}h50M{x:.0f} {y - 25:.0f}v50'/>"
        for x, y in np.column_stack([stations[:, 0] - low[0], high[1] - stations[:, 1]])
    )
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:.0f} {height:.0f}' width='640'>"
        "<rect width='100%' height='100%' fill='#fbfbf9'/>"
        f"<g fill='none' stroke='#2166ac' stroke-width='4'>{''.join(parts)}</g>"
        f"<g fill='none' stroke='#b2182b' stroke-width='8'>{crosses}</g></svg>\n"
    )


def epipolar(folder: Path) -> str:
    """The map of residuals of two aerial images, cut out of the page that the command writes."""
    cases = json.loads((folder / "expected.json").read_text("utf-8"))["cases"]
    (inputs,) = (case["inputs"] for case in cases if case["id"] == "epi-borea-01306-01307")
    first, second = (
        Pinhole(np.array(c["center"]), np.array(c["rotation_rows"]), c["focal"], np.array(c["pp"]))
        for c in (inputs["camera1"], inputs["camera2"])
    )
    pairs = np.array(inputs["tie_points_x1_y1_x2_y2"])
    values = epipolar_residuals(first, pairs[:, :2], second, pairs[:, 2:]).values
    size = tuple(inputs["camera1"]["size"])
    page = residual_page("", pairs[:, :2], values, size, fit_field(pairs[:, :2], values, 2)[-1])
    svg = page[page.index("<svg") : page.index("</svg>")] + "</svg>\n"
    return svg.replace("<svg", "<svg xmlns='http://www.w3.org/2000/svg'", 1)


def main() -> None:
    """Write both pictures."""
    data = Path(sys.argv[1])
    PICTURES.mkdir(exist_ok=True)
    (PICTURES / "aerial.svg").write_text(aerial(data / "borea"), encoding="utf-8")
    (PICTURES / "epipolar.svg").write_text(epipolar(data / "epipolar"), encoding="utf-8")


if __name__ == "__main__":
    main()
