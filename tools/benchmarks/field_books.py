"""One simulated job of two total stations in every format of field books, from one truth.

python tools/benchmarks/field_books.py FOLDER

Both faces, heights of both ends, collimation and index errors of each instrument, noise, and one target
height that is written wrong. Readings are whole arc seconds and millimetres, which every format can write.
"""

import math
import random
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

SECOND = math.pi / 648_000
TURN = 1_296_000
PLACES = {
    "S1": (1000.0, 2000.0, 100.0),
    "S2": (1060.0, 2080.0, 103.0),
    "S3": (1150.0, 2020.0, 95.0),
    "S4": (1080.0, 1950.0, 101.0),
    "P5": (980.0, 2070.0, 110.0),
    "P6": (1040.0, 1980.0, 92.0),
}
"""East, north, height (m)."""
KNOWN = ("S1", "S3")
INSTRUMENTS = {"TS-A": (4.0, -6.0), "TS-B": (-9.0, 3.0)}
"""Collimation and index error (arc seconds)."""
SET_UPS = (("S1", "TS-A", 1.52), ("S2", "TS-B", 1.61), ("S3", "TS-A", 1.47), ("S4", "TS-B", 1.58))
TARGET_HEIGHTS = {"S1": 1.40, "S2": 1.55, "S3": 1.30, "S4": 1.62, "P5": 1.75, "P6": 1.80}
WRONG = ("S2", "P6", 1.60)
"""Station and target of the sight whose target height is written wrong, and what is written."""
ANGLE, LENGTH = 2.0, 1.0
"""Standard deviations of readings (arc seconds, mm)."""
SEED = 28


@dataclass(frozen=True)
class Shot:
    """A sight: target, its written height (m), face, circle, vertical angle (arc seconds), distance (mm)."""

    target: str
    height: float
    face: int
    circle: int
    vertical: int
    distance: int


@dataclass(frozen=True)
class SetUp:
    """A set-up: its point, instrument and height (m), and its sights."""

    point: str
    instrument: str
    height: float
    shots: list[Shot]


def job() -> list[SetUp]:
    """The truth as two instruments read it."""
    chance = random.Random(SEED)
    return [
        SetUp(point, name, height, _shots(point, name, height, chance)) for point, name, height in SET_UPS
    ]


def _shots(point: str, instrument: str, height: float, chance: random.Random) -> list[Shot]:
    collimation, index = INSTRUMENTS[instrument]
    zero, shots = chance.randrange(TURN), []
    targets = [name for name in PLACES if name != point]
    for face, order in ((1, targets), (2, targets[::-1])):
        for target in order:
            east, north, up = (b - a for a, b in zip(PLACES[point], PLACES[target], strict=True))
            up += TARGET_HEIGHTS[target] - height
            flat = math.hypot(east, north)
            zenith = math.atan2(flat, up)
            azimuth = math.atan2(east, north) / SECOND
            sign = 3 - 2 * face
            circle = azimuth - zero + sign * collimation / math.sin(zenith) + (face - 1) * TURN / 2
            vertical = index + (zenith / SECOND if face == 1 else TURN - zenith / SECOND)
            written = WRONG[2] if (point, target) == WRONG[:2] else TARGET_HEIGHTS[target]
            shots.append(
                Shot(
                    target,
                    written,
                    face,
                    round(circle + chance.gauss(0, ANGLE)) % TURN,
                    round(vertical + chance.gauss(0, ANGLE)) % TURN,
                    round(math.hypot(flat, up) * 1000 + chance.gauss(0, LENGTH)),
                )
            )
    return shots


def sixty(seconds: int, point: str = ".") -> str:
    """Degrees, then two digits of minutes and two of seconds."""
    return f"{seconds // 3600}{point}{seconds // 60 % 60:02d}{seconds % 60:02d}"


def gsi(setups: list[SetUp]) -> Iterator[str]:
    """Leica GSI-16, sexagesimal."""
    for setup in setups:
        yield f"*12....+{setup.instrument:0>16} 16....+{setup.point:0>16} 88..10+{setup.height * 1e3:016.0f} "
        for shot in setup.shots:
            yield (
                f"*110001+{shot.target:0>16} 21.324+{sixty(shot.circle, '') + '0':0>16} "
                f"22.324+{sixty(shot.vertical, '') + '0':0>16} 31..00+{shot.distance:016d} "
                f"87..10+{shot.height * 1e3:016.0f} "
            )


def jobxml(setups: list[SetUp]) -> Iterator[str]:
    """Trimble JobXML, distances without the prism constant."""
    prism, number = -0.034, 0
    yield '<?xml version="1.0" encoding="UTF-8"?>\n<JOBFile jobName="job" version="5.60">\n<FieldBook>'
    for k, setup in enumerate(setups):
        yield f"<InstrumentRecord>\n<Model>{setup.instrument}</Model>\n</InstrumentRecord>"
        yield f'<StationRecord ID="s{k}">\n<StationName>{setup.point}</StationName>'
        yield f"<TheodoliteHeight>{setup.height}</TheodoliteHeight>\n</StationRecord>"
        for shot in setup.shots:
            number += 1
            yield f'<TargetRecord ID="t{number}">\n<PrismConstant>{prism}</PrismConstant>'
            yield f"<TargetHeight>{shot.height}</TargetHeight>\n</TargetRecord>"
            yield f'<PointRecord ID="p{number}">\n<Name>{shot.target}</Name>\n<Method>DirectReading</Method>'
            yield "<Classification>Normal</Classification>\n<Deleted>false</Deleted>\n<Circle>"
            yield f"<HorizontalCircle>{shot.circle / 3600:.12f}</HorizontalCircle>"
            yield f"<VerticalCircle>{shot.vertical / 3600:.12f}</VerticalCircle>"
            yield f"<EDMDistance>{shot.distance / 1e3 - prism:.4f}</EDMDistance>"
            yield f"<Face>Face{shot.face}</Face>\n</Circle>"
            yield f"<StationID>s{k}</StationID>\n<TargetID>t{number}</TargetID>\n</PointRecord>"
    yield "</FieldBook>\n</JOBFile>"


def landxml(setups: list[SetUp]) -> Iterator[str]:
    """LandXML, decimal degrees."""
    yield '<?xml version="1.0" encoding="UTF-8"?>\n<LandXML version="1.2">\n<Units>'
    yield '<Metric linearUnit="meter" angularUnit="decimal degrees" directionUnit="decimal degrees"/>'
    yield "</Units>\n<Survey>\n<Equipment>"
    for name in INSTRUMENTS:
        yield f'<InstrumentDetails id="{name}" model="{name}"/>'
    yield "</Equipment>"
    for k, setup in enumerate(setups):
        yield f'<InstrumentSetup id="s{k}" instrumentDetailsID="{setup.instrument}"'
        yield f' stationName="{setup.point}" instrumentHeight="{setup.height}"/>'
        yield f'<ObservationGroup setupID="s{k}">'
        for shot in setup.shots:
            yield f'<RawObservation horizAngle="{shot.circle / 3600:.12f}" targetHeight="{shot.height}"'
            yield f' zenithAngle="{shot.vertical / 3600:.12f}" slopeDistance="{shot.distance / 1e3:.3f}"'
            yield f' directFace="{str(shot.face == 1).lower()}">\n<TargetPoint name="{shot.target}"/>'
            yield "</RawObservation>"
        yield "</ObservationGroup>"
    yield "</Survey>\n</LandXML>"


def sdr(setups: list[SetUp]) -> Iterator[str]:
    """Sokkia SDR33, decimal degrees."""
    yield "00NMSDR33 V04-04.02     01-Jan-26 08:00 111211\n10NMJOB             121111"
    for setup in setups:
        yield f"01NM:{setup.instrument:15}      000001{'':16}      31"
        yield f"02TP{setup.point:>16}{'':48}{setup.height:<16.3f}{'':16}"
        for shot in setup.shots:
            yield f"03NM{shot.height:<16.3f}"
            yield (
                f"09F{shot.face}{setup.point:>16}{shot.target:>16}{shot.distance / 1e3:<16.3f}"
                f"{shot.vertical / 3600:<16.11f}{shot.circle / 3600:<16.11f}{'':16}"
            )


def rw5(setups: list[SetUp]) -> Iterator[str]:
    """Carlson RW5, metres, angles to the right."""
    yield "JB,NMjob,DT01-01-2026,TM08:00:00\nMO,AD0,UN1,SF1.00000000,EC0,EO0.0,AU0"
    for setup in setups:
        yield f"OC,OP{setup.point}"
        yield f"BK,OP{setup.point},BP{setup.shots[0].target},BS0.0000,BC{sixty(setup.shots[0].circle)}"
        for shot in setup.shots:
            yield f"LS,HI{setup.height:.4f},HR{shot.height:.4f}"
            yield (
                f"F{'DR'[shot.face - 1]},OP{setup.point},FP{shot.target},AR{sixty(shot.circle)},"
                f"ZE{sixty(shot.vertical)},SD{shot.distance / 1e3:.3f},--"
            )


def nikon(setups: list[SetUp]) -> Iterator[str]:
    """Nikon RAW."""
    yield "CO,Nikon RAW data format V2.00\nCO,Dist Units: Metres\nCO,Angle Units: DDDMMSS"
    yield "CO,Zero VA: Zenith\nCO,Coord Order: NEZ"
    for setup in setups:
        yield f"CO,Instrument: {setup.instrument}\nST,{setup.point},,,,{setup.height:.3f},0.0000,0.0000"
        for shot in setup.shots:
            yield (
                f"F{shot.face},{shot.target},{shot.height:.3f},{shot.distance / 1e3:.3f},"
                f"{sixty(shot.circle)},{sixty(shot.vertical)},08:00:00"
            )


def m5(setups: list[SetUp]) -> Iterator[str]:
    """Zeiss and Trimble M5."""
    number = 0

    def line(kind: str, info: str, *values: tuple[str, str, str]) -> str:
        nonlocal number
        number += 1
        blocks = [f"{name:2} {value:>14} {unit:4}|" for name, value, unit in values]
        blocks += [f"{'':22}|"] * (3 - len(blocks))
        return f"For M5|Adr {number:05d}|{kind:3} {info:27}|{''.join(blocks)} "

    for setup in setups:
        yield line("TI", "UN STAT")
        yield line("TI", "INPUT", ("ih", f"{setup.height:.3f}", "m"))
        yield line("PI1", f"{'':10}S{'':4}{setup.point:>12}")
        yield line("TI", "POLAR")
        for shot in setup.shots:
            yield line("TI", "INPUT", ("th", f"{shot.height:.3f}", "m"))
            yield line(
                "PI1",
                f"{'':15}{shot.target:>12}",
                ("SD", f"{shot.distance / 1e3:.3f}", "m"),
                ("Hz", sixty(shot.circle), "DMS"),
                ("V1", sixty(shot.vertical), "DMS"),
            )


def geodimeter(setups: list[SetUp]) -> Iterator[str]:
    """Geodimeter: both faces of a target beneath it."""
    yield "50=job\n23=2112"
    for setup in setups:
        yield f"55={setup.instrument}\n2={setup.point}\n3={setup.height:.3f}"
        for shot in setup.shots:
            circle, vertical = (7, 8) if shot.face == 1 else (17, 18)
            yield f"5={shot.target}\n6={shot.height:.3f}\n{circle}={sixty(shot.circle)}"
            yield f"{vertical}={sixty(shot.vertical)}\n9={shot.distance / 1e3:.3f}"


def gts7(setups: list[SetUp]) -> Iterator[str]:
    """Topcon GTS-7."""
    yield "GTS-700 v3.0\nJOB     job,\nUNITS   M,D"
    for setup in setups:
        yield f"INST    {setup.instrument}\nSTN     {setup.point},{setup.height:.3f},"
        for shot in setup.shots:
            yield f"SS      {shot.target},{shot.height:.3f},"
            yield f"SD      {sixty(shot.circle)},{sixty(shot.vertical)},{shot.distance / 1e3:.3f}"


def gts(setups: list[SetUp]) -> Iterator[str]:
    """Topcon GTS-210, one line without an end."""
    marks = []
    for setup in setups:
        marks.append(f"_'{setup.point}_(_){setup.height:.3f}")
        marks += [
            f"_+{shot.target}_ ?+{shot.distance:08d}m{sixty(shot.vertical, ''):0>7}"
            f"+{sixty(shot.circle, ''):0>7}d+00000000t60+00+00000_*_,{shot.height:.3f}"
            for shot in setup.shots
        ]
    yield "".join(marks) + "_"


FORMATS: dict[str, Callable[[list[SetUp]], Iterator[str]]] = {
    "job.gsi": gsi,
    "job.jxl": jobxml,
    "job.xml": landxml,
    "job.sdr": sdr,
    "job.rw5": rw5,
    "nikon.raw": nikon,
    "job.m5": m5,
    "job.job": geodimeter,
    "job.gts7": gts7,
    "job.gts": gts,
}
"""What writes each file."""


def known() -> str:
    """The known points, as a table."""
    rows = (f"{name},{','.join(map(str, PLACES[name]))},0.0005,0.0005,0.0005" for name in KNOWN)
    return "\n".join(("name,x,y,z,sx,sy,sz", *rows)) + "\n"


def write(folder: Path) -> None:
    """Writes the job in all formats, and the known points."""
    folder.mkdir(parents=True, exist_ok=True)
    setups = job()
    for name, lines in FORMATS.items():
        (folder / name).write_text("\n".join(lines(setups)) + "\n", encoding="utf-8")
    (folder / "known.csv").write_text(known(), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
