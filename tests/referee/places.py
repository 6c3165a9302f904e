"""Where networks lie: frames and systems of points all over the Earth, or nowhere on it."""

import numpy as np
from referee.earth import WGS84, Frame, Ground, System, euler, tangent

BESSEL = Ground(6377397.155, 0.006674372231802145, (674.374, 15.056, 405.346))
SWISS = (
    "+proj=somerc +lat_0=46.95240555555556 +lon_0=7.439583333333333 +k_0=1 +x_0=2600000 +y_0=1200000 "
    "+ellps=bessel"
)
LAMBERT = "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=700000 +y_0=6600000 +ellps=GRS80"
POLAR = "+proj=stere +lat_0=90 +lat_ts=90 +lon_0=0 +k=0.994 +x_0=2000000 +y_0=2000000 +ellps=WGS84"


def from_plan(projection, ellipsoid):
    """Steps of PROJ from a projection to geocentric axes."""
    return f"+step +inv {projection} +step +proj=cart +ellps={ellipsoid}"


def placed(random, dialect):
    """A frame and the system of the points, somewhere; and a word for where."""
    where = random.choice(["plane", "pole", "pole", "anywhere", "anywhere", "date line", "map", "rigid"])
    if dialect == "comp3d":
        return _comp3d_place(random, where)
    if where == "plane":
        frame = Frame("Local", "plane")
        return frame, System("Local", frame), where
    if where == "map":
        return _on_a_map(random)
    latitude = float(np.sign(random.uniform(-1, 1)) * random.uniform(88, 90 - 1e-4))
    if where != "pole":
        latitude = float(random.uniform(-75, 75))
    longitude = float(
        random.uniform(-180, 180) if where != "date line" else random.choice([179.9999, -179.9999])
    )
    frame = tangent(longitude, latitude, float(random.choice([0.0, 350.0])))
    if where == "rigid":
        return (*_rigid(random, frame), where)
    if random.random() < 0.5:
        return frame, System("EPSG:4326", frame, "degrees"), where
    if where == "pole" and latitude > 0 and random.random() < 0.5:
        return frame, System("EPSG:5041", frame, from_plan(POLAR, "WGS84")), where
    return frame, System(frame.definition, frame), where


def _rigid(random, near):
    """A frame without verticals."""
    if random.random() < 0.4:
        frame = Frame("GeoC", "rigid")
        return frame, System("GeoC", frame)
    angles = random.uniform(-3, 3, 3).tolist()
    definition = "LEuc*" + "*".join(repr(float(x)) for x in (*near.T, *angles))
    frame = Frame(definition, "rigid", euler(*angles), near.T)
    return frame, System(definition, frame)


def _on_a_map(random):
    word = random.choice(["Lambert", "UTM", "Swiss"])
    if word == "Swiss":
        frame = tangent(float(random.uniform(6.5, 9.5)), float(random.uniform(46, 47.4)), 450.0, BESSEL)
        shift = "+step +proj=helmert +x=674.374 +y=15.056 +z=405.346"
        definition = f"{SWISS} +towgs84=674.374,15.056,405.346,0,0,0,0 +units=m +no_defs"
        return frame, System(definition, frame, f"{from_plan(SWISS, 'bessel')} {shift}"), word
    frame = tangent(float(random.uniform(1, 5)), float(random.uniform(44, 49)), 100.0)
    if word == "Lambert":
        return frame, System("EPSG:2154", frame, from_plan(LAMBERT, "WGS84")), word
    return frame, System("EPSG:32631", frame, from_plan("+proj=utm +zone=31 +ellps=WGS84", "WGS84")), word


def _comp3d_place(random, where):
    """A project of Comp3D: a stereographic plane around its centre, or a map."""
    if where in ("map", "anywhere"):
        frame, system, word = _on_a_map(random)
        while word == "Swiss":
            frame, system, word = _on_a_map(random)
        centre = np.round(np.real(system.coordinates(np.zeros(3)))[:2]).tolist()
    else:
        latitude = float(
            random.uniform(-75, 75) if where != "pole" else random.choice([-1, 1]) * random.uniform(88, 90)
        )
        centre = random.choice([[0.0, 0.0], [5000.0, -3000.0]]).tolist()
        projection = f"+proj=sterea +lat_0={latitude!r} +lon_0=0 +k_0=1 +x_0={centre[0]!r} +y_0={centre[1]!r}"
        system, word = (
            System(projection, None, from_plan(f"{projection} +ellps=WGS84", "WGS84")),
            f"local {where}",
        )
    earth = np.array(system._proj.transform(*centre, 0.0))
    longitude, latitude, _ = np.real(WGS84.geodetic(earth))
    origin = tangent(float(np.degrees(longitude)), float(np.degrees(latitude)), 0.0)
    frame = Frame(f"RTL*{centre[0]!r}*{centre[1]!r}*0*{system.definition}", "tangent", origin.R, origin.T)
    return frame, System(system.definition, frame, system.to_earth), word
