"""What is told and written of an adjusted block of satellite images."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.errors import InputError
from obseq.images.aerial.rpc import rpc_through
from obseq.images.output.text_tables import text_table
from obseq.images.satellite.block import GEOGRAPHIC
from obseq.kernels import calculator
from obseq.reading.tables import table_text

if TYPE_CHECKING:
    from obseq.images.aerial.rpc import Rpc
    from obseq.images.satellite.block import SatelliteSolution

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
    terms = calculator(f"Dist_Polyn2D_Degree_{block.degree}_EqDist").observations
    rows = [
        (image, term, f"{value:.6g}", f"{sigma:.3g}")
        for image, (values, sigmas) in solution.corrections().items()
        for term, value, sigma in zip(terms, values.tolist(), sigmas.tolist(), strict=True)
    ]
    heads = ("image", "term", "value", "sigma")
    title = "\n\nCorrections, pixels from the offsets of the image\n"
    return "\n".join(lines) + title + text_table(heads, rows) + _checked(solution)


def _checked(solution: SatelliteSolution) -> str:
    names, differences, covariances = solution.check()
    if not names:
        return ""
    sigmas = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    within = int(np.count_nonzero(np.abs(differences) <= 1.96 * sigmas))
    rms = np.sqrt(np.mean(differences**2, axis=0))
    rows = [("rms", *map("{:.3f}".format, rms))]
    rows += [
        (name, *map("{:+.3f}".format, row)) for name, row in zip(names, differences.tolist(), strict=True)
    ]
    title = f"\nCheck points, adjusted minus given; {within} of {differences.size} within 1.96 sigmas\n"
    return title + text_table(("point", "east", "north", "up"), rows)


def point_table(solution: SatelliteSolution) -> str:
    """Points: longitude, latitude, height, and sigmas along east, north and up."""
    to_geographic = crs.Transformer(crs.parse(solution.block.frame), crs.parse(GEOGRAPHIC))
    places = np.asarray(to_geographic.forward(solution.coordinates)).tolist()
    sigmas = np.sqrt(np.diagonal(solution.covariances, axis1=1, axis2=2)).tolist()
    rows = [(name, *xyz, *own) for name, xyz, own in zip(solution.points, places, sigmas, strict=True)]
    return table_text(("point", "x", "y", "z", "sx", "sy", "sz"), rows)


def correction_table(solution: SatelliteSolution) -> str:
    """Coefficients of the corrections, with their sigmas."""
    terms = calculator(f"Dist_Polyn2D_Degree_{solution.block.degree}_EqDist").observations
    rows = [
        (image, term, value, sigma)
        for image, (values, sigmas) in solution.corrections().items()
        for term, value, sigma in zip(terms, values.tolist(), sigmas.tolist(), strict=True)
    ]
    return table_text(("image", "term", "value", "sigma"), rows)


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
