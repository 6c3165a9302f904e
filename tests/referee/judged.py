"""The boundary: networks as files, adjusted by obseq, and its results beside those of the referee."""

import json
from dataclasses import dataclass, replace

import numpy as np
from referee.adjusted import UndeterminedError, adjust, freed, inner_covariance
from referee.network import ANGLES

from obseq.errors import ObseqError
from obseq.survey import Datum, Network, Quality, estimating

RADIANS = {"rad": 1.0, "gon": np.pi / 200, "deg": np.pi / 180}
UNITS = ("rad", "gon", "deg")
CODES = {
    "Dist": 3,
    "DH": 4,
    "Hz": 5,
    "Zen": 6,
    "Azim": 8,
    "DX": 14,
    "DY": 15,
    "DZ": 16,
    "DistHz0": 2,
    "DistHz": 101,
}
PARTIAL = {"00-": 4, "00s": 5, "--0": 6, "ss0": 7}  # flags of points of one or two dimensions
TURNED = ("AxisPlane", "AxisFoot")  # an axis may point either way
PROJ = 1e-7  # metres: two ways through PROJ to one place
ARC_SECONDS = 648000 / np.pi


def text(*numbers):
    """Numbers as files hold them, to the last bit."""
    return " ".join(repr(float(x)) for x in numbers)


def flags(point):
    """The flag of a COR line, and its sigmas; a free coordinate of a known point has a negative one."""
    pattern = "".join("-" if np.isnan(s) else "0" if s == 0 else "s" for s in point.sigmas)
    if pattern == "---":
        return 0, ""
    return PARTIAL.get(pattern, 1), text(*np.where(np.isnan(point.sigmas), -1.0, point.sigmas))


def cor_lines(network):
    """The points of a network in a COR file."""
    for p in network.points:
        if p.is_unplaced:
            continue
        flag, sigmas = flags(p)
        deflection = "" if p.deflection is None else text(*np.multiply(p.deflection, ARC_SECONDS))
        yield f"{flag} {p.name} {text(*p.given)} {sigmas} {deflection}"


def obs_line(o, unit, code=None):
    """One line of an OBS file."""
    factor = RADIANS[unit] if o.kind in ANGLES else 1.0
    numbers = text(o.value / factor, o.sigma / factor, o.relative, o.hi, o.ht)
    return f"{code or CODES[o.kind]} {o.a} {o.b} {numbers}"


def obs_lines(case):
    """The observations of a case in the dialect of OBS files."""
    setup, instrument, network = None, None, case.network
    for o in network.observations:
        if o.setup >= 0 and o.setup != setup and o.kind != "Azim":
            yield f"#{network.setups[o.setup].orientation}"
            setup = o.setup
        if o.instrument != instrument:
            instrument = o.instrument
            yield f"#INSTRUMENT {instrument}".strip()
        yield obs_line(o, "gon")


def table_lines(case):
    """The observations of a case as a table."""
    columns = (
        "type",
        "from",
        "to",
        "value",
        "sigma",
        "unit",
        "set",
        "orientation",
        "instrument",
        "relative_sigma",
        "from_height",
        "to_height",
        "backsight",
        "weights",
        "cluster",
        "covariances",
    )
    yield ",".join(columns)
    network, clustered = case.network, {}
    for number, (rows, block) in enumerate(network.clusters):
        clustered |= {row: (number, block[k, :k]) for k, row in enumerate(rows)}
    for row, o in enumerate(network.observations):
        is_angle = o.kind in ANGLES
        unit = case.unit if is_angle else "m"
        unit = "" if o.kind in ("Lat", "Lon") else unit
        factor = RADIANS[case.unit] if unit == case.unit and is_angle else 1.0
        if o.kind in ("Lat", "Lon"):
            factor, unit = RADIANS["deg"], "deg"
        of_setup = (o.setup, network.setups[o.setup].orientation) if o.setup >= 0 else ("", "")
        cluster, covariances = clustered.get(row, ("", ()))
        cells = (
            o.kind,
            o.a,
            " ".join(o.members) or o.b,
            text(o.value / factor),
            text(o.sigma / factor),
            unit,
            *of_setup,
            o.instrument,
            text(o.relative),
            text(o.hi),
            text(o.ht),
            o.backsight,
            text(*o.weights),
            cluster,
            text(*covariances),
        )
        yield ",".join(map(str, cells))


def point_lines(network):
    """The points of a network as a table."""
    yield "name,x,y,z,sx,sy,sz"
    for p in network.points:
        if p.is_unplaced:
            continue
        sigmas = ["" if np.isnan(s) else repr(float(s)) for s in p.sigmas]
        yield ",".join([p.name, *(repr(float(x)) for x in p.given), *sigmas])


def comp3d_files(case):
    """By name, the files of a case as a project of Comp3D."""
    network, files, lines = case.network, {}, []
    centre = [float(x) for x in network.frame.definition.split("*")[1:3]]
    done, opened = set(), {}
    for row, o in enumerate(network.observations):
        if row in done:
            continue
        sub = network.setups[o.setup] if o.setup >= 0 else None
        rows = [o]
        if o.kind in ("DX", "Alpha") and sub.orientation != "GRID":
            name, rows = f"sub{o.setup}.xyz", network.observations[row : row + 3]
            code = 11 if o.kind == "DX" else 12
            if name not in files:
                files[name] = []
                lines.append(f"{code} {o.a} @{name} {'V' if sub.orientation == 'VERT' else 'N'}")
            files[name].append(_sub_frame(rows, case.unit))
        elif o.kind == "VX":
            name, rows = f"vector{row}.bas", network.observations[row : row + 3]
            block = next(block for members, block in network.clusters if members[0] == row)
            files[name] = [f"{o.b} {text(*(v.value for v in rows), *block[np.triu_indices(3)])}"]
            lines.append(f"19 {o.a} @{name}")
        elif o.kind in ("AxisRadius", "AxisFoot"):
            name = f"{o.axis}.axe"
            if name not in files:
                files[name] = []
                lines.append(f"18 {o.a} @{name}")
            rows = network.observations[row : row + 2] if o.kind == "AxisRadius" else [o]
            target = o.group.replace("/", "_")
            files[name].append(
                f"L {o.b}"
                if o.kind == "AxisFoot"
                else f"{target} {o.b} {o.b} {text(*(v.sigma for v in rows))}"
            )
        elif o.kind.startswith("Equal"):
            name = f"{o.group}.eq"
            if name not in files:
                files[name] = []
                lines.append(f"{21 if o.kind == 'EqualDH' else 22} @{name}")
            files[name].append(f"{o.a} {o.b} {text(o.sigma)}")
        else:
            code = 7 if o.kind == "Hz" and o.setup not in opened else None
            opened[o.setup] = True
            lines.append(obs_line(o, case.unit, code))
        done.update(range(row, row + len(rows)))
    config = {
        "root_COR_file": "p.cor",
        "root_OBS_file": "o.obs",
        "use_proj": not case.place.startswith("local"),
        "proj_def": network.system.definition,
        "local_center": [*centre, 0.0],
        "refraction": network.refraction,
        "files_unit": UNITS.index(case.unit),
        "use_ellips_height": True,
        "compute_type": 0,
        "internal_constraints": False,
        "max_iterations": 100,
        "center_latitude": 0.0,
        "coord_cov_file": "",
    }
    if case.place.startswith("local"):
        config["center_latitude"] = float(network.system.definition.split("+lat_0=")[1].split()[0])
    if network.known is not None:
        config["coord_cov_file"] = "known.txt"
        names = [f"{name}_{'xyz'[k]}" for name, k in network.known[0]]
        rows = [f"{name} {text(*row)}" for name, row in zip(names, network.known[1], strict=True)]
        files["known.txt"] = ["param " + " ".join(names), *rows]
    files |= {
        "p.cor": list(cor_lines(network)),
        "o.obs": lines,
        "project.comp": ["data=" + json.dumps({"config": config})],
    }
    return files


def _sub_frame(rows, unit):
    values = [o.value / (RADIANS[unit] if o.kind in ANGLES else 1.0) for o in rows]
    if rows[0].kind == "DX":
        return f"{rows[0].b} {text(*values, *(o.sigma for o in rows), 0.0, rows[0].ht)}"
    angular = rows[0].sigma / RADIANS[unit]
    return f"{rows[0].b} {text(*values, angular, 0.0, rows[2].sigma, 0.0, rows[0].ht)}"


def written_order(case):
    """Rows of the observations as the files have them: those of one file of Comp3D stand together."""
    if case.dialect != "comp3d":
        return np.arange(len(case.network.observations))
    first = {}
    keys = []
    for row, o in enumerate(case.network.observations):
        orientation = case.network.setups[o.setup].orientation if o.setup >= 0 else ""
        file = o.axis or (o.group.split("/")[0] if o.kind != "Dist" else o.group)
        if not file and o.kind in ("DX", "DY", "DZ", "Alpha", "Beta") and orientation != "GRID":
            file = f"polar{o.setup + 1}" if o.kind in ("Alpha", "Beta") else f"sub{o.setup}"
        keys.append(first.setdefault(file or row, row))
    return np.argsort(keys, kind="stable")


def read(case, folder):
    """The network of a case as obseq reads it from files in a folder."""
    network = case.network
    systems = {"frame": network.frame.definition, "points_crs": network.system.definition}
    if case.dialect == "comp3d":
        files = comp3d_files(case)
    elif case.dialect == "table":
        files = {"p.csv": point_lines(network), "o.csv": table_lines(case)}
    else:
        files = {"p.cor": cor_lines(network), "o.obs": obs_lines(case)}
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
        return max(1e3 * max(sizes), 1e6 * self.redundancies)

    @property
    def is_good(self):
        return not self.said and self.worst() <= 1.0 and self.more <= 3


def judge(case, folder):
    """The verdict on one network; None where the referee finds nothing determined."""
    network = case.network
    try:
        found = adjust(network)
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
    if wants_inner and adjustment.inner is not None and not verdict.said:
        verdict.inner = _of_inner(network, found, adjustment)
    return verdict


def compared(case, network, found, adjustment):
    """The verdict on an adjustment."""
    verdict, solution = Verdict(case.seed, iterations=found.iterations), adjustment.solution
    verdict.more = len(solution.iterations) - found.iterations
    verdict.accused = "; ".join(error.text for error in adjustment.gross_errors)[:300]
    if not adjustment.converged:
        verdict.said = f"not converged: {solution.ending}"
    elif adjustment.left_out:
        verdict.said = f"left out: {adjustment.left_out[0].sentence()[:200]}"
    elif solution.redundancy != found.freedom:
        verdict.said = f"redundancy {solution.redundancy}, not {found.freedom}"
    rows = [found.names[name] for name in adjustment.points.names if name in found.names]
    if verdict.said or len(rows) != len(found.names):
        verdict.said = verdict.said or "points are missing"
        return verdict
    scalars = np.array([3 * row + k for row in rows for k in range(3)])
    ours = found.covariance[np.ix_(scalars, scalars)]
    spread = np.sqrt(np.maximum(np.diag(ours), 0.0))
    away = (adjustment.points.coordinates - found.xyz[rows]).ravel()
    verdict.coordinates = float((np.maximum(np.abs(away) - PROJ, 0.0) / np.maximum(spread, 1e-6)).max())
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
    controlled = redundancy > 1e-4
    gaps = np.abs(quality.standardised[kept] - w)[controlled]
    verdict.standardised = float(gaps.max(initial=0.0))
    return verdict


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
