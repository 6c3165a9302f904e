"""What is told and written of an adjusted block of satellite images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from obseq import crs
from obseq.errors import InputError
from obseq.images.aerial.rpc import Rpc, rpc_through
from obseq.images.satellite.block import GEOGRAPHIC, SatelliteSolution
from obseq.kernels import calculator
from obseq.reading.tables import table_text
from obseq.report.tables.columns import Table, choice, column, table
from obseq.report.tables.units import METRIC
from obseq.report.writer import Writer

LAYERS, CELLS = 5, 15
"""Heights, and cells of the ground a side, of the grid on which a corrected image is fitted."""
LARGEST = 0.05
"""Pixels by which rational polynomials of a corrected image may be off."""


def summary(solution: SatelliteSolution) -> str:
    """A screenful."""
    result, block = solution.result, solution.block
    sigma0 = "undefined" if result.sigma0 is None else f"{result.sigma0:.4f}"
    control = set(block.control.names) & set(solution.points)
    rms = float(np.sqrt(np.mean(np.sum(solution.residuals() ** 2, axis=1)))) if len(solution.rows) else 0.0
    lines = [
        f"Satellite block: sigma0 {sigma0}, {'converged' if result.converged else 'NOT CONVERGED'} after "
        f"{len(result.iterations)} iterations",
        f"  {len(block.measures.image_names)} images, {len(solution.points)} points, {len(control)} of them "
        f"control points; {len(solution.rows)} image points, rms {rms:.4g} px",
        f"  redundancy {result.redundancy}",
        f"  correction: {block.correction}; frame {block.frame}",
    ]
    if solution.left_out:
        lines.append(f"  left out, one ray each: {', '.join(solution.left_out[:10])}")
    written = Writer([], METRIC)
    tables = [_corrections(solution), *_checked(solution)]
    return "\n".join(lines) + "\n\n" + "\n\n".join("\n".join(written.lines(one)) for one in tables) + "\n"


def _corrections(solution: SatelliteSolution) -> Table:
    rows = list(_terms(solution))
    columns = [
        choice("image", [image for image, *_ in rows]),
        choice("term", [term for _, term, *_ in rows]),
        column("value", "value", [value for *_, value, _ in rows]),
        column("sigma", "small_number", [sigma for *_, sigma in rows]),
    ]
    return table("corrections", "Corrections", columns, about="Pixels from the offsets of the image.")


def _terms(solution: SatelliteSolution) -> Iterator[tuple[str, str, float, float]]:
    """Image, name, value and sigma of each."""
    terms = calculator(f"Dist_Polyn2D_Degree_{solution.block.degree}_EqDist").observations
    for image, (values, sigmas) in solution.corrections().items():
        for term, value, sigma in zip(terms, values.tolist(), sigmas.tolist(), strict=True):
            yield image, term, value, sigma


def _checked(solution: SatelliteSolution) -> Iterator[Table]:
    names, differences, covariances = solution.check()
    if not names:
        return
    sigmas = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    within = int(np.count_nonzero(np.abs(differences) <= 1.96 * sigmas))
    rms = ", ".join(f"{value:.3f}" for value in np.sqrt(np.mean(differences**2, axis=0)))
    axes = zip(("east", "north", "up"), differences.T.tolist(), strict=True)
    columns = [choice("point", names), *(column(axis, "length", values) for axis, values in axes)]
    about = f"Adjusted minus given; rms {rms}; {within} of {differences.size} within 1.96 sigmas."
    yield table("check-points", "Check points", columns, about=about)


def point_table(solution: SatelliteSolution) -> str:
    """Points: longitude, latitude, height, and sigmas along east, north and up."""
    to_geographic = crs.Transformer(crs.parse(solution.block.frame), crs.parse(GEOGRAPHIC))
    places = np.asarray(to_geographic.forward(solution.coordinates)).tolist()
    sigmas = np.sqrt(np.diagonal(solution.covariances, axis1=1, axis2=2)).tolist()
    rows = [(name, *xyz, *own) for name, xyz, own in zip(solution.points, places, sigmas, strict=True)]
    return table_text(("point", "x", "y", "z", "sx", "sy", "sz"), rows)


def correction_table(solution: SatelliteSolution) -> str:
    """Coefficients of the corrections, with their sigmas."""
    return table_text(("image", "term", "value", "sigma"), list(_terms(solution)))


def corrected_rpc(solution: SatelliteSolution, image: str) -> Rpc:
    """Rational polynomials with the correction in them: exact for a shift, else fitted over their ground.

    Raises:
        InputError: they cannot hold it to a twentieth of a pixel.
    """
    rpc, (values, _) = solution.block.rpcs[image], solution.corrections()[image]
    if solution.block.degree == 0:
        shift = dict(zip(("SAMP", "LINE"), values.tolist(), strict=True))
        return replace(rpc, offsets={key: value + shift.get(key, 0.0) for key, value in rpc.offsets.items()})
    corrector = calculator(f"Dist_Polyn2D_Degree_{solution.block.degree}_EqDist")
    unit = np.stack(
        np.meshgrid(*[np.linspace(-1.0, 1.0, n) for n in (CELLS, CELLS, LAYERS)], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    offsets, scales = (
        np.array([part[key] for key in ("LONG", "LAT", "HEIGHT")]) for part in (rpc.offsets, rpc.scales)
    )
    ground = offsets + unit * scales
    middle = np.array([rpc.offsets["SAMP"], rpc.offsets["LINE"]])
    pixels = rpc.project(ground) - middle
    wanted = corrector.values(pixels, np.repeat(values[None], len(pixels), axis=0)) + middle
    found = rpc_through(ground, wanted)
    off = float(np.abs(found.project(ground) - wanted).max())
    if not off <= LARGEST:
        raise InputError(f"image {image}: rational polynomials hold its correction only to {off:.3g} pixels")
    return found
