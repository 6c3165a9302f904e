"""Networks of a wanted size in the files of each format: a square grid, whose points see the next four.

Each function writes the files of about n observations into a folder, and returns those that a reader gets.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import field_books
import numpy as np

from obseq.formats.conversion import write_dynaml
from obseq.survey import Network

Sight = tuple[str, float, float, float]
"""Target, azimuth (deg), zenith angle (deg), distance (m)."""
CRS = "+proj=sterea +lat_0=48.8 +lon_0=2.4 +k_0=1 +x_0=0 +y_0=0 +datum=WGS84"
STATIONS_OF_A_SOLUTION = 40
"""Stations of one SINEX file, whose covariance is dense."""


def positions(n: int) -> list[tuple[str, float, float, float]]:
    """Points of a square grid: name, east, north, height."""
    side = math.isqrt(n) + 1
    return [(f"P{k}", 100.0 * (k % side), 100.0 * (k // side), 10.0 + k % 7) for k in range(n)]


def network(n: int) -> tuple[list[tuple[str, float, float, float]], list[tuple[str, list[Sight]]]]:
    """The points, and the sights of each set-up: a direction, a zenith angle and a distance each."""
    points, setups = positions(n // 12 + 5), []
    for k in range(n // 12):
        sights = []
        for j in range(1, 5):
            east, north, up = (points[k + j][axis] - points[k][axis] for axis in (1, 2, 3))
            flat = math.hypot(east, north)
            zenith = math.degrees(math.atan2(flat, up))
            azimuth = math.degrees(math.atan2(east, north)) % 360
            sights.append((points[k + j][0], azimuth, zenith, math.hypot(flat, up)))
        setups.append((points[k][0], sights))
    return points, setups


def written(path: Path, lines: Iterable[str]) -> Path:
    """Writes lines; the path."""
    path.write_text("\n".join(lines) + "\n")
    return path


def gama(folder: Path, n: int) -> list[Path]:
    """GNU Gama."""
    return [written(folder / "n.gkf", _gama(n))]


def _gama(n: int) -> Iterator[str]:
    points, setups = network(n)
    yield '<gama-local><network axes-xy="en"><points-observations direction-stdev="10"'
    yield ' zenith-angle-stdev="10" distance-stdev="5">'
    for k, (name, east, north, up) in enumerate(points):
        part = 'fix="xyz"' if k % 10 == 0 else 'adj="xyz"'
        yield f'<point id="{name}" x="{east}" y="{north}" z="{up}" {part} />'
    for origin, sights in setups:
        yield f'<obs from="{origin}">'
        for target, azimuth, zenith, distance in sights:
            yield f'<direction to="{target}" val="{azimuth / 0.9:.5f}" />'
            yield f'<z-angle to="{target}" val="{zenith / 0.9:.5f}" />'
            yield f'<s-distance to="{target}" val="{distance:.4f}" />'
        yield "</obs>"
    yield "</points-observations></network></gama-local>"


def starnet(folder: Path, n: int) -> list[Path]:
    """STAR*NET."""
    return [written(folder / "n.dat", _starnet(n))]


def _starnet(n: int) -> Iterator[str]:
    points, setups = network(n)
    yield ".3D\n.UNITS Meters GONS\n.ORDER EN"
    for k, (name, east, north, up) in enumerate(points):
        yield f"C {name} {east} {north} {up}" + (" ! ! !" if k % 10 == 0 else "")
    for origin, sights in setups:
        yield f"DB {origin}"
        for target, azimuth, zenith, distance in sights:
            yield f"DM {target} {azimuth / 0.9:.5f} {distance:.4f} {zenith / 0.9:.5f} 1 0.005 1"
        yield "DE"


def landxml(folder: Path, n: int) -> list[Path]:
    """LandXML."""
    return [written(folder / "n.xml", _landxml(n))]


def _landxml(n: int) -> Iterator[str]:
    points, setups = network(n)
    yield '<LandXML><Units><Metric linearUnit="meter" angularUnit="grads"/></Units><CgPoints>'
    for k, (name, east, north, up) in enumerate(points):
        known = ' pntSurv="control"' if k % 10 == 0 else ""
        yield f'<CgPoint name="{name}"{known}>{north} {east} {up}</CgPoint>'
    yield "</CgPoints><Survey>"
    for origin, sights in setups:
        yield f'<InstrumentSetup id="s{origin}" stationName="{origin}"/>'
        yield f'<ObservationGroup setupID="s{origin}">'
        for target, azimuth, zenith, distance in sights:
            yield f'<RawObservation horizAngle="{azimuth / 0.9:.5f}" zenithAngle="{zenith / 0.9:.5f}"'
            yield f' slopeDistance="{distance:.4f}"><TargetPoint pntRef="{target}"/></RawObservation>'
        yield "</ObservationGroup>"
    yield "</Survey></LandXML>"


def obs(folder: Path, n: int) -> list[Path]:
    """OBS and COR files."""
    points, setups = network(n)
    written(folder / "p.cor", _cor(points))
    return [written(folder / "o.obs", _obs(setups)), folder / "p.cor"]


def _cor(points: list[tuple[str, float, float, float]]) -> Iterator[str]:
    for k, (name, east, north, up) in enumerate(points):
        yield (
            f"1 {name} {east} {north} {up} 0.01 0.01 0.01" if k % 10 == 0 else f"0 {name} {east} {north} {up}"
        )


def _obs(setups: list[tuple[str, list[Sight]]]) -> Iterator[str]:
    for origin, sights in setups:
        for number, (target, azimuth, zenith, distance) in enumerate(sights):
            yield f"{5 if number else 7} {origin} {target} {azimuth / 0.9:.5f} 0.001 0.0001 1.5 1.6"
            yield f"6 {origin} {target} {zenith / 0.9:.5f} 0.001 0.0001 1.5 1.6"
            yield f"3 {origin} {target} {distance:.4f} 0.002 1e-6 1.5 1.6"


def comp3d(folder: Path, n: int) -> list[Path]:
    """A project of Comp3D; half of its observations stand in the files of sub-frames."""
    points, setups = network(n)
    half = len(setups) // 2
    written(folder / "p.cor", _cor(points))
    east, north = points[len(points) // 2][1:3]
    settings = {"root_COR_file": "p.cor", "root_OBS_file": "o.obs", "files_unit": 1}
    config = settings | {"local_center": [east, north, 0], "refraction": 0.12}
    named = []
    for k, (origin, sights) in enumerate(setups[half:]):
        rows = [(target, *_local(azimuth, zenith, distance)) for target, azimuth, zenith, distance in sights]
        lines = [f"{target} {x:.4f} {y:.4f} {z:.4f} 0.002" for target, x, y, z in rows]
        named.append(f"11 {origin} @f{k}.xyz V 1.0")
        written(folder / f"f{k}.xyz", lines)
    written(folder / "o.obs", [*_obs(setups[:half]), *named])
    return [written(folder / "n.comp", ["data=", json.dumps({"config": config})])]


def _local(azimuth: float, zenith: float, distance: float) -> tuple[float, float, float]:
    flat, turn = distance * math.sin(math.radians(zenith)), math.radians(azimuth)
    return flat * math.sin(turn), flat * math.cos(turn), distance * math.cos(math.radians(zenith))


def tables(folder: Path, n: int) -> list[Path]:
    """Tables with named columns."""
    points, setups = network(n)
    head = ["name,x,y,z,sx,sy,sz"]
    rows = [
        f"{name},{e},{n},{u}" + (",0,0,0" if k % 10 == 0 else ",,,")
        for k, (name, e, n, u) in enumerate(points)
    ]
    written(folder / "p.csv", [*head, *rows])
    return [written(folder / "o.csv", _table(setups)), folder / "p.csv"]


def _table(setups: list[tuple[str, list[Sight]]]) -> Iterator[str]:
    yield "type,from,to,value,sigma,unit,set,instrument"
    for origin, sights in setups:
        for target, azimuth, zenith, distance in sights:
            yield f"Hz,{origin},{target},{azimuth / 0.9:.5f},0.001,gon,1,TS"
            yield f"Zen,{origin},{target},{zenith / 0.9:.5f},0.001,gon,1,TS"
            yield f"Dist,{origin},{target},{distance:.4f},0.002,m,1,TS"


def dna(folder: Path, n: int) -> list[Path]:
    """DNA files of DynAdjust: half of the measurements single, half vectors."""
    points, setups = network(n)
    head = f"!#=DNA 3.01 STN{'01.01.2020':>14}{'GDA2020':>14}{'01.01.2020':>14}{len(points):>10}"
    stations = [head]
    for k, (name, east, north, up) in enumerate(points):
        latitude, longitude = -35.0 + north / 111e3, 149.0 + east / 91e3
        parts = f"{_packed(latitude):>20}{_packed(longitude):>20}{up:>20.4f}"
        stations.append(f"{name:<20}{'CCC' if k % 10 == 0 else 'FFF'} LLh{parts}S55 ")
    written(folder / "n.stn", stations)
    lines = [head.replace("STN", "MSR")]
    for origin, sights in setups:
        for target, azimuth, zenith, distance in sights:
            ends = f"{origin:<20}{target:<20}{'':20}"
            lines.append(f"S {ends}{distance:>14.4f}{'':14}{0.01:>9}{0:>7}{0:>7}")
            lines.append(f"V {ends}{'':14}{_columns(zenith)}{1:>9}{0:>7}{0:>7}")
            lines.append(f"B {ends}{'':14}{_columns(azimuth)}{1:>9}")
    return [folder / "n.stn", written(folder / "n.msr", lines)]


def _packed(angle: float) -> str:
    """d.mmssss, as DynAdjust packs angles."""
    seconds = round(abs(angle) * 3600, 5)
    degrees, rest = divmod(seconds, 3600)
    minutes, seconds = divmod(rest, 60)
    return f"{'-' if angle < 0 else ''}{int(degrees)}.{int(minutes):02d}{f'{seconds:08.5f}'.replace('.', '')}"


def _columns(angle: float) -> str:
    """Degrees, minutes, seconds in columns."""
    degrees, rest = divmod(round(angle * 3600, 4), 3600)
    minutes, seconds = divmod(rest, 60)
    return f"{int(degrees):>4}{int(minutes):>2}{seconds:>8.4f}"


def dynaml(folder: Path, n: int) -> list[Path]:
    """DynaML from the DNA files, in the layout of DynAdjust: one element a line."""
    write_dynaml(folder / "n.xml", Network.read_project(dna(folder, n)))
    packed = (folder / "n.xml").read_text()
    return [written(folder / "n.xml", packed.replace("><", ">\n<").splitlines())]


def sinex(folder: Path, n: int) -> list[Path]:
    """SINEX: as many solutions as needed, since the covariance of one is dense."""
    size, chance = 3 * STATIONS_OF_A_SOLUTION, np.random.default_rng(0)
    root = chance.normal(size=(size, size)) / size + np.eye(size)
    matrix, paths = 1e-6 * root @ root.T, []
    places = 6378137.0 * np.array([0.6, 0.1, 0.79]) + chance.normal(scale=1e4, size=(size // 3, 3))
    for k in range(max(n // size, 1)):
        values = (places + chance.normal(scale=1e-3, size=places.shape)).ravel()
        paths.append(written(folder / f"s{k}.snx", _sinex(values, matrix)))
    return paths


def _sinex(values: np.ndarray, matrix: np.ndarray) -> Iterator[str]:
    size = len(values)
    yield f"%=SNX 2.02 AGY 20:001:00000 AGY 20:001:00000 20:001:00000 P {size:05d} 2 S"
    yield "+SOLUTION/ESTIMATE"
    for k, value in enumerate(values.tolist()):
        head = f" {k + 1:5d} STA{'XYZ'[k % 3]}   S{k // 3:03d}  A    1 20:001:00000 m    2"
        yield f"{head} {value:21.14E} {math.sqrt(matrix[k, k]):11.5E}"
    yield "-SOLUTION/ESTIMATE"
    yield "+SOLUTION/MATRIX_ESTIMATE L COVA"
    for row in range(size):
        for first in range(0, row + 1, 3):
            part = matrix[row, first : min(first + 3, row + 1)]
            yield f" {row + 1:5d} {first + 1:5d} " + " ".join(f"{value:21.14E}" for value in part)
    yield "-SOLUTION/MATRIX_ESTIMATE"
    yield "%ENDSNX"


def field_book(name: str) -> Callable[[Path, int], list[Path]]:
    """What writes field books: a simulated job again and again, with its known points."""

    def write(folder: Path, n: int) -> list[Path]:
        setups = field_books.job()
        again = setups * (n // sum(3 * len(setup.shots) for setup in setups))
        known = written(folder / "known.csv", field_books.known().splitlines())
        return [written(folder / name, field_books.FORMATS[name](again)), known]

    return write


FORMATS: dict[str, Callable[[Path, int], list[Path]]] = {
    "OBS, COR": obs,
    "Comp3D": comp3d,
    "Gama": gama,
    "DNA": dna,
    "DynaML": dynaml,
    "SINEX": sinex,
    "STAR*NET": starnet,
    "LandXML": landxml,
    "tables": tables,
    **{name: field_book(name) for name in field_books.FORMATS},
}
"""What writes the files of each format."""
