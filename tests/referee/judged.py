"""The boundary: networks as files, adjusted by obseq, and its results beside those of the referee."""

from dataclasses import dataclass, replace

import numpy as np
from referee.adjusted import UndeterminedError, adjust, freed, inner_covariance
from referee.apart import cost, is_undecided, lowest, weak_points
from referee.files import comp3d_files, cor_lines, obs_lines, point_lines, table_lines, written_order

from obseq.errors import ObseqError
from obseq.survey import Datum, Network, Quality, estimating

TURNED = ("AxisPlane", "AxisFoot")  # an axis may point either way
PROJ = 5e-7  # metres: two ways through PROJ to one place, near a pole
HIGHER = 1e-6  # share of a sum of squares by which a reference must stand above to be another minimum


def read(case, folder):
    """The network of a case as obseq reads it from files in a folder."""
    network = case.network
    systems = {"frame": network.frame.definition, "points_crs": network.system.definition}
    if case.dialect == "comp3d":
        files = comp3d_files(case)
    elif case.dialect == "table":
        files = {"p.csv": point_lines(network), "o.csv": table_lines(case)}
    else:
        files = {"p.cor": cor_lines(network), "o.obs": obs_lines(network)}
    for name, lines in files.items():
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    if case.dialect == "comp3d":
        found = Network.read_project(folder / "project.comp")
    elif case.dialect == "table":
        found = Network.read_project(
            [folder / "p.csv", folder / "o.csv"], refraction=network.refraction, **systems
        )
    else:
        found = Network.read(folder / "o.obs", folder / "p.cor", refraction=network.refraction, **systems)
    return (
        replace(found, book=estimating(found.book, sorted(network.estimate))) if network.estimate else found
    )


@dataclass
class Verdict:
    """How far obseq is from the referee.

    `coordinates`, `covariances` and `residuals` are in standard deviations, `redundancies` in parts.
    `rounding` is what PROJ itself loses there and back, in the smallest sigma of a known coordinate.
    `uncertain` is the last step of the referee, in standard deviations: redundancies turn with it.
    `apart` tells why a network is no disagreement: the referee has found so, asked again.
    """

    seed: int
    said: str = ""
    coordinates: float = 0.0
    sigma0: float = 0.0
    covariances: float = 0.0
    redundancies: float = 0.0
    residuals: float = 0.0
    standardised: float = 0.0
    inner: float = 0.0
    accused: str = ""
    apart: str = ""
    rounding: float = 0.0
    uncertain: float = 0.0
    iterations: int = 0
    more: int = 0

    def worst(self):
        """The largest deviation, in 1e-3 standard deviations or 1e-6 of redundancies."""
        sizes = (
            self.coordinates,
            self.sigma0,
            self.covariances,
            self.residuals,
            self.standardised,
            self.inner,
        )
        return max(1e3 * (max(sizes) - self.rounding), 1e6 * (self.redundancies - self.uncertain))

    @property
    def is_good(self):
        return not self.said and self.worst() <= 1.0 and self.more <= 3


def judge(case, folder):
    """The verdict on one network; None where the referee finds nothing determined."""
    network = case.network
    try:
        found = given = adjust(network)
        if network.inner is not None:
            network = freed(network, found.xyz)
            found = adjust(network)
    except (UndeterminedError, np.linalg.LinAlgError):
        return None
    datum = Datum() if network.inner is None else Datum("inner", tuple(network.inner))
    wants_inner = network.inner is None and case.seed % 4 == 0
    try:
        adjustment = read(case, folder).adjust(datum=datum, quality=Quality(inner=wants_inner))
    except ObseqError as error:
        return Verdict(case.seed, f"refused: {str(error)[:300]}")
    verdict = compared(case, network, found, adjustment)
    if verdict.is_good:
        if wants_inner and adjustment.inner is not None:
            verdict.inner = _of_inner(network, found, adjustment)
        return verdict
    weak = weak_points(case.network, given) | weak_points(network, found)
    return _asked_again(case, network, found, adjustment, verdict, weak)


def _asked_again(case, network, found, adjustment, verdict, weak):
    """A verdict that is not good, or what the referee says when it knows what obseq has found."""
    names, places = adjustment.points.names, adjustment.points.coordinates
    out = {p.name for p in network.points} - {
        name for name, xyz in zip(names, places, strict=True) if np.isfinite(xyz).all()
    }
    if out and out <= weak:
        return replace(verdict, apart=f"{', '.join(sorted(out))} uncertain by a hundredth of the size")
    if adjustment.left_out and all(is_undecided(network, item) for item in adjustment.left_out):
        return replace(verdict, apart="two places fit as well")
    again = None if out else lowest(network, dict(zip(names, places, strict=True)))
    if again is None or network.inner is not None or cost(again) > cost(found) * (1.0 - HIGHER):
        return verdict
    other = compared(case, network, again, adjustment)
    if other.said or other.worst() > 1.0:
        return verdict
    return replace(other, apart=f"the reference stood at {cost(found):.6g} instead of {cost(again):.6g}")


def compared(case, network, found, adjustment):
    """The verdict on an adjustment."""
    verdict, solution = Verdict(case.seed, iterations=found.iterations), adjustment.solution
    verdict.more = len(solution.iterations) - found.iterations
    verdict.accused = "; ".join(error.text for error in adjustment.gross_errors)[:300]
    if not adjustment.converged:
        verdict.said = f"not converged: {solution.ending}"
    elif adjustment.left_out:
        verdict.said = f"left out: {adjustment.left_out[0].sentence[:200]}"
    elif solution.redundancy != found.freedom:
        verdict.said = f"redundancy {solution.redundancy}, not {found.freedom}"
    rows = [found.names[name] for name in adjustment.points.names if name in found.names]
    if verdict.said or len(rows) != len(found.names):
        verdict.said = verdict.said or "points are missing"
        return verdict
    scalars = np.array([3 * row + k for row in rows for k in range(3)])
    ours = found.covariance(scalars)
    spread = np.sqrt(np.maximum(np.diag(ours), 0.0))
    away = (adjustment.points.coordinates - found.xyz[rows]).ravel()
    verdict.coordinates = deviation(away, ours)
    verdict.rounding, verdict.uncertain = rounding(network), found.length
    ids = solution.table.find(list(adjustment.points.names), "Point3")
    theirs = solution.covariance_between(ids, ids, a_priori=True)
    scale = np.maximum(spread, 1e-7)
    verdict.covariances = float((np.abs(theirs - ours) / np.outer(scale, scale)).max())
    verdict.sigma0 = _relative(solution.sigma0, found.sigma0)
    verdict.sigma0 = max(verdict.sigma0, _relative(solution.variance_factor, found.variance_factor))
    n = len(network.observations)
    kept = np.flatnonzero(adjustment.book.observations.active)
    if len(kept) != n:
        verdict.said = f"{len(kept)} observations, not {n}"
        return verdict
    order = written_order(replace(case, network=network))
    quality, sigmas = adjustment.quality.observations, adjustment.sigmas[kept]
    residuals, redundancy, w = (
        part[order] for part in (found.residuals, found.redundancy, found.standardised)
    )
    kinds = [network.observations[row].kind for row in order]
    signs = np.where(np.isin(kinds, TURNED) & (residuals * adjustment.residuals[kept] < 0), -1.0, 1.0)
    residuals, w = signs * residuals, signs * w
    verdict.residuals = float((np.abs(adjustment.residuals[kept] - residuals) / sigmas).max())
    verdict.redundancies = float(np.abs(quality.redundancy[kept] - redundancy).max())
    controlled = redundancy > 1e-3
    gaps = np.abs(quality.standardised[kept] - w)[controlled]
    verdict.standardised = float(gaps.max(initial=0.0))
    return verdict


def rounding(network):
    """What given coordinates lose in PROJ on the way to the frame and back, in their smallest sigma."""
    sigmas = np.array([p.sigmas for p in network.points])
    known = (sigmas > 0).any(axis=1)
    if not known.any():
        return 0.0
    given = network.given[known]
    places = network.system.placed(given)
    lost = np.abs(np.real(network.system.gap(places, given))) * network.system.metres(places)
    return float(np.nanmax(lost / np.where(sigmas[known] > 0, sigmas[known], np.nan)))


def deviation(away, covariance):
    """The largest of some differences, in standard deviations; rounding of PROJ is none."""
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return float((np.maximum(np.abs(away) - PROJ, 0.0) / np.maximum(spread, 1e-6)).max(initial=0.0))


def _of_inner(network, found, adjustment):
    """Deviation of the precisions of inner constraints, in parts of variances; 0 where there are none."""
    ours = inner_covariance(network, found)
    if ours is None:
        return 0.0
    rows = np.array([found.names[name] for name in adjustment.points.names])
    blocks = np.array([ours[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] for row in rows])
    theirs = adjustment.inner / (adjustment.solution.variance_factor or 1.0)
    seen = np.isfinite(theirs).all(axis=(1, 2))
    scale = np.maximum(np.trace(blocks, axis1=1, axis2=2), 1e-14)[:, None, None]
    return float((np.abs(theirs - blocks) / scale)[seen].max(initial=0.0))


def _relative(theirs, ours):
    if theirs is None or np.isnan(ours):
        return 0.0 if (theirs is None) == bool(np.isnan(ours)) else np.inf
    return abs(theirs - ours) / max(ours, 1e-9)
