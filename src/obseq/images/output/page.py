"""The report of an adjusted block as one HTML page that needs nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.output.arrays import arrays_of, interior, suspected_measures
from obseq.images.output.control_page import BAD, MOST_ROWS, instruments, largest_tests, reliability, table
from obseq.images.output.drawings import arrows, grid_of, histogram, radial_profile, undistorted_grid
from obseq.images.output.references_told import check_points, references
from obseq.images.output.summary import by_reason, suspected, tested
from obseq.images.output.views import plan_and_side
from obseq.report.html import escaped

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.images.output.arrays import BlockArrays
    from obseq.images.output.block_record import BundleRecord, CameraRecord

MOST_IMAGES = 60
"""Images with a drawing of their own."""
HALF = 0.5
"""Weight below which a measure is listed as weakened."""
SMALL = 220.0
STRONG = 0.95
STYLE = """
:root{color-scheme:light dark;--line:#888;--ink:#1f77b4;--second:#d95f02;--bad:#b02a1c}
@media(prefers-color-scheme:dark){:root{--ink:#6db3e8;--second:#ff9a4d;--bad:#ff9184}}
body{font:15px system-ui,sans-serif;margin:1rem auto;max-width:64rem;padding:0 1rem}
main{display:flex;flex-wrap:wrap;gap:1rem}figure{margin:0;max-width:100%}figcaption{font-size:.85em}
svg{max-width:100%;height:auto;font:11px system-ui,sans-serif}svg text{fill:currentColor}
table{border-collapse:collapse;font-size:.85em}td,th{padding:.1rem .5rem;text-align:right}
td:first-child,th:first-child{text-align:left}tr:nth-child(even){background:#8882}
.scroll{overflow:auto;max-height:28rem}.bad{color:var(--bad);font-weight:bold}.strong{background:#d95f0255}
.frame,.given,.axis{fill:none;stroke:var(--line)}.arrow,.first{fill:none;stroke:var(--ink)}
.second{fill:none;stroke:var(--second)}.bin{fill:#8886}.bar{stroke:currentColor;stroke-width:2}
.ray{fill:none;stroke:#8883;stroke-width:.5}.ellipse{fill:#1f77b422;stroke:var(--ink);stroke-width:.6}
.suspect{fill:none;stroke:var(--bad);stroke-width:2}
.tie{fill:currentColor}.control{fill:var(--bad)}.camera{fill:#3a7d4455;stroke:#3a7d44}
"""


def page(record: BundleRecord) -> str:
    """The page of a record: drawings, cameras, images, points, what was rejected and why."""
    block, marked = arrays_of(record), suspected_measures(record)
    parts = [
        _facts(record),
        *_views(block),
        *largest_tests(record),
        *(part for k, camera in enumerate(record.cameras) for part in _camera(block, camera, k, marked)),
        _images(block, record, marked),
        *_points(block, record),
        *instruments(record),
        *reliability(record),
        *_rejected(block, record),
    ]
    title = escaped(f"Block of {len(record.images)} images, {len(record.points)} points")
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>'
        f"<body><h1>{title}</h1>\n{''.join(parts)}</body></html>\n"
    )


def _facts(record: BundleRecord) -> str:
    state = (
        "converged"
        if record.converged
        else f'<span class="bad">NOT CONVERGED: {escaped(record.stopped)}</span>'
    )
    sigma0 = "undefined" if record.sigma0 is None else f"{record.sigma0:.5g}"
    squares = ", ".join(f"{escaped(name)} {value:.6g}" for name, value in record.squares.items())
    is_rejected = record.global_test is not None and not record.global_test.passed
    lines = [
        _bad(suspected(record)),
        f"sigma0 {sigma0}; {state} after {len(record.iterations)} iterations",
        f"{record.n_observations} equations, {record.n_unknowns} unknowns, redundancy {record.redundancy}; "
        f"precisions {record.precision}",
        _bad(f"WEAK, without precisions: {record.weak}" if record.weak else ""),
        _bad(tested(record).strip()) if is_rejected else escaped(tested(record).strip()),
        f"weighted sums of squares: {squares}",
        f"{len(record.left_out)} things left out, {len(record.unmeasured)} control points in no image, "
        f"{record.weakened} image points with less than half of their weight, {len(record.behind)} behind "
        "their camera (at the end of this page)",
        *(_bad(f"Warning: {failure}") for failure in record.failures),
        *(f"note: {escaped(note)}" for note in record.notes),
        f"run {escaped(record.run.identifier)}, format {record.format} {record.version}",
    ]
    return "".join(f"<p>{line}</p>" for line in lines if line)


def _bad(text: str) -> str:
    return f"<span{BAD}>{escaped(text)}</span>" if text else ""


def _views(block: BlockArrays) -> Iterator[str]:
    for title, drawing in plan_and_side(block).items():
        caption = "<figcaption>cameras, rays, control points in red</figcaption>"
        yield f"<h2>{title}</h2><figure>{drawing}{caption}</figure>"


def _camera(block: BlockArrays, camera: CameraRecord, number: int, marked: BoolArray) -> Iterator[str]:
    rows = np.flatnonzero(block.camera[block.image] == number)
    xy, residuals = block.xy[rows], block.residuals[rows]
    normalised = (residuals / block.sigmas[rows]).ravel()
    sound = block.weights[rows] >= HALF
    size, (focal, middle) = (camera.width, camera.height), interior(camera)
    straight = np.array([camera.undistorted_x, camera.undistorted_y], dtype=np.float64).T
    drawings = {
        "residuals (computed minus measured) of all images; suspected ones in red circles": arrows(
            size, xy, residuals, "residuals", suspected=marked[rows]
        ),
        "by radius, without what robust weights weaken: radial part (blue), rms (orange)": radial_profile(
            middle, xy[sound], residuals[sound], "radial profile"
        ),
        "residuals over sigmas, and the normal curve": histogram(normalised, "histogram"),
        "the image (grey) without distortion (blue)": undistorted_grid(
            grid_of(size, focal), straight, "undistorted grid"
        ),
    }
    yield f"<h2>Camera {escaped(camera.name)}</h2>"
    yield _calibration(camera)
    figures = (
        f"<figure>{drawing}<figcaption>{title}</figcaption></figure>" for title, drawing in drawings.items()
    )
    yield f"<main>{''.join(figures)}</main>"


def _calibration(camera: CameraRecord) -> str:
    """Parameters, sigmas and correlations; strong ones are marked."""
    names = [parameter.name for parameter in camera.parameters]
    rows = []
    for k, parameter in enumerate(camera.parameters):
        sigma = "-" if parameter.sigma is None else f"{parameter.sigma:.3g}" if parameter.sigma else "fixed"
        cells = [f"<td>{escaped(parameter.name)}</td><td>{parameter.value:.10g}</td><td>{sigma}</td>"]
        cells += [_correlation(camera, k, other) for other in range(k)]
        rows.append(f"<tr>{''.join(cells)}</tr>")
    heads = "".join(f"<th>{escaped(word)}</th>" for word in ("parameter", "value", "sigma", *names[:-1]))
    size = f"{camera.width} by {camera.height} pixels, " if camera.width else ""
    facts = f"<p>{size}{escaped(camera.projection)}, degree {camera.degree}; {camera.n_measures} measures, "
    matrix = f"<table><tr>{heads}</tr>{''.join(rows)}</table>"
    return f"{facts}rms {camera.rms:.4g} px</p><div class='scroll'>{matrix}</div>"


def _correlation(camera: CameraRecord, row: int, column: int) -> str:
    if camera.correlations is None:
        return "<td></td>"
    value = camera.correlations[row][column]
    style = ' class="strong"' if abs(value) > STRONG else ""
    return f"<td{style}>{value:+.2f}</td>" if value else "<td></td>"


def _images(block: BlockArrays, record: BundleRecord, marked: BoolArray) -> str:
    order = sorted(range(len(record.images)), key=lambda k: -record.images[k].rms)
    rows = [
        (
            image.name, image.n_measures, f"{image.rms:.4g}", f"{image.largest:.4g}",
            f"{image.mean_dx:+.3f}", f"{image.mean_dy:+.3f}",
            *(f"{value:.4f}" for value in image.centre), _largest(image.centre_sigmas),
        )
        for image in (record.images[k] for k in order[:MOST_ROWS])
    ]  # fmt: skip
    heads = ("image", "points", "rms px", "max px", "mean dx", "mean dy", "x", "y", "z", "sigma")
    drawings = "".join(_image(block, record, k, marked) for k in order[:MOST_IMAGES])
    note = f"<p>drawings of the {MOST_IMAGES} worst images</p>" if len(order) > MOST_IMAGES else ""
    return f"<h2>Images</h2>{table(heads, rows, len(record.images))}{note}<main>{drawings}</main>"


def _image(block: BlockArrays, record: BundleRecord, row: int, marked: BoolArray) -> str:
    rows = np.flatnonzero(block.image == row)
    camera = record.cameras[block.camera[row]]
    size = camera.width, camera.height
    xy, residuals = block.xy[rows], block.residuals[rows]
    drawing = arrows(size, xy, residuals, "residuals of an image", SMALL, marked[rows])
    caption = escaped(record.images[row].name)
    if marked[rows].any():
        caption += f" <span{BAD}>{np.count_nonzero(marked[rows])} suspected</span>"
    return f"<figure>{drawing}<figcaption>{caption}</figcaption></figure>"


def _points(block: BlockArrays, record: BundleRecord) -> Iterator[str]:
    control = [point for point in record.points if point.residual is not None]
    if control:
        control.sort(key=lambda point: -max(map(abs, point.residual or (0.0,))))
        rows = [
            (point.name, point.n_rays, f"{point.rms:.4g}", *map("{:+.5f}".format, point.residual or ()))
            for point in control[:MOST_ROWS]
        ]
        heads = ("point", "rays", "rms px", "dx", "dy", "dz")
        yield f"<h2>Control points, adjusted minus given</h2>{table(heads, rows, len(control))}"
    if record.check_points or record.antennas or record.shutters:
        told = escaped(check_points(record) + references(record))
        yield f"<h2>Check points and references</h2><pre>{told}</pre>"
    yield f"<h2>Points, largest rms first</h2>{_by_point(record, block.largest)}"


def _by_point(record: BundleRecord, largest: FloatArray) -> str:
    rows = []
    rms = np.array([point.rms for point in record.points])
    for k in np.argsort(-rms, kind="stable")[:MOST_ROWS]:
        point = record.points[k]
        spread = [] if point.covariance is None else [point.covariance[place] ** 0.5 for place in (0, 3, 5)]
        places = (f"{value:.4f}" for value in (point.x, point.y, point.z))
        sigmas = [f"{value:.3g}" for value in spread] or ["-"] * 3
        rows.append((point.name, point.n_rays, f"{point.rms:.4g}", f"{largest[k]:.4g}", *places, *sigmas))
    heads = ("point", "rays", "rms px", "max px", "x", "y", "z", "sx", "sy", "sz")
    return table(heads, rows, len(record.points))


def _rejected(block: BlockArrays, record: BundleRecord) -> Iterator[str]:
    left = [(item.kind, item.name, item.reason) for item in record.left_out]
    left += [
        (
            "measure",
            f"image {item.image}, point {item.point}",
            "the point is behind the camera in the solution",
        )
        for item in record.behind
    ]
    if left:
        groups = by_reason(record.left_out)
        shown = table(("what", "how many", "which", "why"), groups, len(groups))
        yield f"<h2>Left out</h2>{shown}"
        yield table(("what", "name", "reason"), left[:MOST_ROWS], len(left))
    idle = [(item.name, item.reason) for item in record.unmeasured]
    if idle:
        title = f"Control points that change nothing ({len(idle)})"
        yield f"<h2>{title}</h2>{table(('name', 'reason'), idle[:MOST_ROWS], len(idle))}"
    apart = [(item.kind, item.name, item.reason) for item in record.unpaired]
    if apart:
        title = "Not in pairs of their rigid blocks"
        yield f"<h2>{title}</h2>{table(('what', 'name', 'reason'), apart[:MOST_ROWS], len(apart))}"
    weak = np.flatnonzero(block.weights < HALF)
    if weak.size:
        order = weak[np.argsort(block.weights[weak], kind="stable")]
        rows = [
            (
                record.images[block.image[k]].name, record.points[block.point[k]].name,
                f"{block.residuals[k, 0]:+.3f}", f"{block.residuals[k, 1]:+.3f}", f"{block.weights[k]:.3g}",
                "beyond the threshold" if block.weights[k] == 0.0 else "large residual, attenuated",
            )
            for k in order[:MOST_ROWS].tolist()
        ]  # fmt: skip
        heads = ("image", "point", "dx px", "dy px", "weight", "why")
        yield f"<h2>Weakened by robust weights</h2>{table(heads, rows, len(weak))}"


def _largest(sigmas: Sequence[float] | None) -> str:
    return "-" if sigmas is None else f"{max(sigmas):.3g}"
