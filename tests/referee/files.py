"""Networks as files of the three dialects, every number to its last bit."""

import json

import numpy as np
from referee.network import ANGLES

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


def obs_lines(network):
    """The observations of a network in the dialect of OBS files."""
    setup, instrument = None, None
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
