"""The boundary: blocks adjusted by obseq beside those of the referee."""

from dataclasses import replace

import numpy as np
from referee.adjusted import UndeterminedError, adjust
from referee.blocks import PARAMETERS, BlockEquations, BlockUnknowns
from referee.files import cor_lines, obs_lines
from referee.judged import Verdict, deviation

from obseq.errors import ObseqError
from obseq.images import (
    BundleAdjustment,
    Camera,
    Clinometer,
    ControlPoints,
    Exposures,
    ImagePoints,
    Poses,
    RigidBlock,
)
from obseq.survey import Network


def built(block, folder):
    """A block as obseq takes it."""
    made = BundleAdjustment()
    for name, values in block.cameras.items():
        made.add_cameras(Camera(name, 4000, 3000, values[0], values[1:3], (3, 1, 1), values[3:]))
    images = block.images
    poses = Poses.of(
        [i.name for i in images],
        [i.centre for i in images],
        [i.turn for i in images],
        cameras=[i.camera for i in images],
    )
    made.add_poses(poses)
    if block.frozen:
        made.freeze_parameters("|".join(block.frozen))
    of_images = {name for names, _, _ in block.measures.values() for name in names}
    known = [p for p in block.points if not np.isnan(p.sigmas).all() and p.name in of_images]
    if known:
        sigmas = [np.where(np.isnan(p.sigmas), np.inf, p.sigmas) for p in known]
        made.add_control_points(ControlPoints.of([p.name for p in known], [p.given for p in known], sigmas))
    free = [p for p in block.points if np.isnan(p.sigmas).all() and p.name in of_images]
    made.add_approximations([p.name for p in free], [p.start for p in free])
    for image, (names, pixels, sigmas) in block.measures.items():
        made.add_measures(ImagePoints.of([image] * len(names), names, pixels, sigmas))
    for entry in block.lengths:
        made.add_length(*entry)
    for image, xyz, sigmas in block.positions:
        pose = poses.select([image])
        made.observe_poses(Poses(pose.images, xyz[None], pose.rotations, pose.cameras), sigmas[None])
    for camera, parameter, value, sigma in block.priors:
        made.observe_parameters(parameter, sigma, camera, value)
    if block.pairs:
        places = {"A": (np.zeros(3), np.eye(3)), **block.places}
        rig = Poses.of(list(places), *map(list, zip(*places.values(), strict=True)))
        exposures = Exposures.of([i.name for i in images], r"([AB])_(\d+)")
        made.add_rigid_block(RigidBlock("rig", "A", exposures, rig, *block.rig_sigmas))
    for item in block.clinometers:
        made.add_clinometer(
            Clinometer(item.name, item.axis, tuple(item.correction), item.free, item.is_fixed)
        )
        read = [entry for entry in block.inclinations if entry[0] == item.name]
        _, names, angles, sigmas = zip(*read, strict=True)
        made.add_inclinations(item.name, names, angles, sigmas)
    if block.observations:
        made.add_survey(_survey(block, of_images, folder))
    return made


def _survey(block, of_images, folder):
    """The survey of a block, through files; its points that images have are free there."""
    own = [p for p in block.points if p.name not in of_images]
    network = replace(block, points=own)
    lines = {"o.obs": obs_lines(network), "p.cor": cor_lines(network)}
    for name, text in lines.items():
        (folder / name).write_text("\n".join(text) + "\n", encoding="utf-8")
    return Network.read(
        folder / "o.obs", folder / "p.cor", frame=block.frame.definition, refraction=block.refraction
    )


def judge_block(seed, block, folder):
    """The verdict on one block; None where the referee finds it undetermined."""
    try:
        found = adjust(block, BlockEquations, BlockUnknowns)
    except (UndeterminedError, np.linalg.LinAlgError):
        return None
    try:
        solution = built(block, folder).solve(datum=block.datum)
    except ObseqError as error:
        return Verdict(seed, f"refused: {str(error)[:300]}")
    return _compared(Verdict(seed, iterations=found.iterations), block, found, solution)


def _compared(verdict, block, found, solution):
    verdict.more = len(solution.iterations) - found.iterations
    if not solution.converged:
        verdict.said = f"not converged: {solution.result.ending}"
    elif solution.left_out:
        verdict.said = f"left out: {solution.left_out[0]}"[:200]
    elif solution.result.redundancy != found.freedom:
        verdict.said = f"redundancy {solution.result.redundancy}, not {found.freedom}"
    if verdict.said:
        return verdict
    verdict.sigma0 = abs((solution.result.variance_factor or 0.0) / found.variance_factor - 1.0)
    _parameters(verdict, block, found, solution)
    _measures(verdict, block, found, solution)
    return verdict


def _parameters(verdict, block, found, solution):
    """Coordinates, centres, rotations and calibrations, and their covariances, points with centres too."""
    at, factor = found.unknowns.at, solution.result.variance_factor or 1.0
    points = np.concatenate(
        [np.arange(at["point", name].start, at["point", name].stop) for name in solution.points]
    )
    images = solution.poses.images
    centres = np.concatenate(
        [np.arange(at["centre", name].start, at["centre", name].stop) for name in images]
    )
    values = found.unknowns.values
    verdict.coordinates = max(
        deviation(solution.coordinates.ravel() - values[points], found.covariance(points)),
        deviation(solution.poses.centres.ravel() - values[centres], found.covariance(centres)),
    )
    ids = solution.equations.points, solution.equations.centres
    for first, rows in zip(ids, (points, centres), strict=True):
        for second, columns in zip(ids, (points, centres), strict=True):
            theirs = solution.covariance_between(first, second) / factor
            ours = found.spread[rows] @ found.spread[columns].T
            scale = np.sqrt(
                np.outer((found.spread[rows] ** 2).sum(axis=1), (found.spread[columns] ** 2).sum(axis=1))
            )
            verdict.covariances = max(
                verdict.covariances, float((np.abs(theirs - ours) / np.maximum(scale, 1e-12)).max())
            )
    for k, name in enumerate(images):
        rows = np.arange(at["turn", "image", name].start, at["turn", "image", name].stop)
        turn = found.unknowns.bases[name]
        off = solution.poses.rotations[k] @ turn.T
        away = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
        ours = found.covariance(rows)
        verdict.coordinates = max(verdict.coordinates, deviation(away, ours))
        theirs = turn @ (solution.rotation_covariances[k] / factor) @ turn.T
        verdict.covariances = max(verdict.covariances, float(np.abs(theirs - ours).max() / np.trace(ours)))
    for name in block.cameras:
        keys = [(k, at["camera", name, p].start) for k, p in enumerate(PARAMETERS) if p not in block.frozen]
        if keys:
            chosen, rows = map(list, zip(*keys, strict=True))
            camera = solution.cameras[name]
            away = (
                np.array([camera.focal, *camera.principal_point, *camera.distortion])[chosen] - values[rows]
            )
            verdict.coordinates = max(verdict.coordinates, deviation(away, found.covariance(rows)))
            theirs, ours = (
                solution.camera_covariance(name)[np.ix_(chosen, chosen)] / factor,
                found.covariance(rows),
            )
            scale = np.sqrt(np.outer(np.diag(ours), np.diag(ours)))
            verdict.covariances = max(verdict.covariances, float((np.abs(theirs - ours) / scale).max()))


def _measures(verdict, block, found, solution):
    """Residuals, redundancies and tests of image points, residuals of the survey."""
    place, n = {}, len(block.observations)
    for image in block.images:
        for name in block.measures[image.name][0]:
            place[image.name, name] = n
            n += 2
    mine, quality = solution.residuals, solution.reliability()
    for k in range(len(mine.image)):
        row = place[solution.poses.images[mine.image[k]], solution.points[mine.point[k]]]
        for axis in range(2):
            gap = abs(mine.residuals[k, axis] - found.residuals[row + axis]) / mine.sigmas[k, axis]
            verdict.residuals = max(verdict.residuals, float(gap))
            red = found.redundancy[row + axis]
            verdict.redundancies = max(verdict.redundancies, float(abs(quality.redundancy[k, axis] - red)))
            if red > 1e-4:
                w = abs(quality.w[k, axis] - found.standardised[row + axis])
                verdict.standardised = max(verdict.standardised, float(w))
    for part in solution.surveys:
        own = part.residuals(solution.result)
        sigmas = np.array([o.sigma for o in block.observations])
        gaps = np.abs(own - found.residuals[: len(own)]) / sigmas
        verdict.residuals = max(verdict.residuals, float(gaps.max()))
