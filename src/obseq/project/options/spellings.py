"""The commands of MMVII that have a counterpart here; see `spelling`."""

from __future__ import annotations

from collections.abc import Sequence

from obseq.errors import InputError
from obseq.project.options.bundle_options import KNOWN, TOPO
from obseq.project.options.instrument_spellings import INSTRUMENTS
from obseq.project.options.option_values import Value
from obseq.project.options.spelling import Form, Option, Spelling, as_typed, in_order, switch, value, values
from obseq.project.options.target_spellings import TARGETS


def _groups(given: Sequence[str]) -> list[str]:
    """The arguments of `BlockCamInit`: images, orientation, pattern, [camera, exposure], block."""
    images, orientation, pattern, groups, out = given
    numbers = groups.strip("[]").split(",")
    if len(numbers) != 2:
        raise InputError(f"BlockCamInit: {groups} is not [camera, exposure], two groups of the pattern")
    return [orientation, pattern, out, "--images", images, "--groups", *numbers]


def _point_file(given: Sequence[str]) -> list[str]:
    """The arguments of `ImportGCP`: what follows the fields of the format is left aside."""
    path, fields, out = given
    return [path, fields if fields.endswith("Bla") else f"{fields}Bla", out]


def _name_pattern(name: str, given: Value) -> list[str]:
    """A pattern with what it becomes: its first group where nothing is said."""
    return values("--name-pattern")(name, [given, "$1"] if isinstance(given, str) else given)


def _network(given: Sequence[str]) -> list[str]:
    """The arguments of `TopoAdj` of 2024: observations, points, and where both go."""
    topo, points, topo_out, points_out = given
    return [topo, topo_out, f"GCPDir={points}", f"GCPDirOut={points_out}"]


def _until_converged(name: str, given: Value) -> list[str]:
    """Nothing: from other first values another number of iterations is needed."""
    return value(name)(name, given)[:0]


ITERATIONS = Option("NbIter", "no limit here: iterations end when they have converged", _until_converged)
IMAGES = "IMAGES"
LISTS = "--lists=SetFiltered_GCP"
"""Beginning of the names of the lists that the original writes where nothing is said; a later one counts."""

SPELLINGS = (
    Spelling(
        "ImportGCP",
        "import-gcp",
        "imports 3D points from a text file",
        (Form(("FILE", "FORMAT", "OUT"), _point_file),),
        (
            Option("NameGCP", "of the set", value("--name")),
            Option("ChSys", "[of the points], or [of the file, of the points]", values("--systems")),
            Option("NumL0", "first line that is read, from 0", value("--first-line")),
            Option("NumLast", "line at which reading ends", value("--last-line")),
            Option("PatName", "of names: the first group, or [pattern, name]", _name_pattern),
            Option("NbDigName", "least digits of a name that is a number", value("--name-digits")),
            Option("MulCoord", "factor of all coordinates", value("--multiplier")),
            Option("Sigma", "of all coordinates, m; below 0: free", value("--sigma")),
            Option("AddInfoFree", "points whose field A is this are free", value("--free")),
            Option("Comment", "what begins a comment", value("--comment")),
            Option("Sep", "what separates fields", value("--separator")),
            Option("NoDupL", "leaves out repeated lines", switch("--skip-repeated")),
        ),
        "ImportGCP inputs/coords.cor ANXYZ InitRTL ChSys=[L93,RTL] AddInfoFree=0 Sigma=0.001 Comment=*",
        "Every line of the file that is no comment is a point, or an error with its line.",
    ),
    Spelling(
        "ImportOBS",
        "import-obs",
        "checks a file of survey observations, and copies it",
        (Form(("FILE", "OUT"), in_order(0, 1)),),
        example="ImportOBS inputs/meas.obs Obs1",
        differs="The file is read before it is copied: what is wrong is told with its line.",
    ),
    Spelling(
        "GCPChSysCo",
        "change-sysco",
        "converts 3D points to another coordinate system",
        (Form(("SYSTEM", "IN", "OUT"), in_order(0, 1, 2)),),
        example="GCPChSysCo L93 FinalRTL FinalL93",
        differs="Covariances are turned with the axes; the original leaves them as they are.",
    ),
    Spelling(
        "TopoAdj",
        "topo-adjust",
        "adjusts a survey network",
        (
            Form(("TOPO", "TOPO_OUT"), in_order(0, 1)),
            Form(("TOPO", "POINTS", "TOPO_OUT", "POINTS_OUT"), _network),
        ),
        (
            ITERATIONS,
            *(Option(name, "as the original's", as_typed) for name in TOPO if name != "NbIter"),
        ),
        "TopoAdj Obs1 InitRTL Obs1_out FinalRTL NbIter=5",
        "Precisions are in the report (--json, --html of obseq topo-adjust).",
    ),
    Spelling(
        "EditCalcMTDI",
        "edit-metadata",
        "shows or changes the rules that give metadata from names of images",
        (Form(("FOLDER", "MODE"), in_order(0, 1)),),
        (
            Option("Modif", "[pattern, value, rank]", values("--modify")),
            Option("ImTest", "an image whose value is told", value("--test")),
            Option("Save", "writes the file", switch("--save")),
        ),
        "EditCalcMTDI Std Focalmm Modif=['IGN2_.*-cam-.*.jpg',12,1] Save=1",
    ),
    Spelling(
        "OriCreateCalib",
        "create-calib",
        "writes first calibrations from metadata",
        (Form((IMAGES, "OUT"), lambda given: [given[0], "*", given[1]]),),
        (
            Option("Degree", "[radial, decentring, general] of the distortion", values("--degree")),
            Option("Proj", "projection", value("--projection")),
        ),
        'OriCreateCalib ".*JPG" CalibInit Degree=[3,1,1]',
        "A focal length in pixels needs no known camera.",
    ),
    Spelling(
        "OriPoseEstimCheckGCPDist",
        "check-gcp-distribution",
        "tells which images have points enough, and well spread",
        (
            Form((IMAGES, "POINTS"), lambda given: [given[0], given[1], given[1], LISTS]),
            Form((IMAGES, "POINTS", "MEASURES"), lambda given: [*given, LISTS]),
        ),
        (Option("PrefSave", "of the lists that are written (SetFiltered_GCP)", value("--lists")),),
        'OriPoseEstimCheckGCPDist ".*JPG" TargetsC',
    ),
    Spelling(
        "OriPoseEstimSpaceResection",
        "resection",
        "finds the poses of calibrated images from control points",
        (
            Form((IMAGES, "POINTS", "CALIBRATIONS", "OUT"), in_order(0, 1, 1, 2, 3)),
            Form((IMAGES, "POINTS", "MEASURES", "CALIBRATIONS", "OUT"), in_order(0, 1, 2, 3, 4)),
        ),
        (
            Option("NbTriplets", "tried at most", value("--triplets")),
            Option("MaxErr", "median of the residuals, pixels", value("--max-error")),
        ),
        'OriPoseEstimSpaceResection ".*.jpg" GND Calib Init',
        "Poses are refined until they have converged, and gross errors are named.",
    ),
    Spelling(
        "OriPoseEstim11P",
        "resection-11p",
        "finds poses and calibrations from control points alone",
        (
            Form((IMAGES, "POINTS", "OUT"), in_order(0, 1, 1, 2)),
            Form((IMAGES, "POINTS", "MEASURES", "OUT"), in_order(0, 1, 2, 3)),
        ),
        (
            Option("DegDist", "[radial, decentring, general]", values("--degree")),
            Option("PatFrozen", "parameters that are held", value("--freeze")),
            Option("ValPPRel", "principal point, in shares of the size", values("--principal-point")),
            Option("SzImage", "width and height of the images", values("--size")),
        ),
        'OriPoseEstim11P ".*JPG" TargetsC Lin SzImage=[6000,4000]',
    ),
    Spelling(
        "BlockCamInit",
        "block-init",
        "finds the relative poses of rigidly mounted cameras",
        (Form((IMAGES, "ORIENTATION", "PATTERN", "[CAMERA,EXPOSURE]", "OUT"), _groups),),
        (
            Option("NameBloc", "of the block", value("--name")),
            Option("Master", "camera whose frame is that of the block", value("--master")),
        ),
        'BlockCamInit SetFiltered_GCP_OK_Resec.xml Resec "(.*)_(.*).JPG" [1,2] RigInit',
    ),
    *INSTRUMENTS,
    Spelling(
        "OriBundleAdj",
        "bundle-adjust",
        "adjusts a block of images",
        (Form((IMAGES, "ORIENTATION", "OUT"), in_order(0, 1, 2)),),
        (
            ITERATIONS,
            *(Option(name, "as the original's", as_typed) for name in KNOWN if name != "NbIter"),
        ),
        'OriBundleAdj ".*.jpg" Init Adjusted GCPDir=GND GCPW=[1,0.5] PPFzCal=".*" PoseVisc=[1,1]',
        "Everything that is written belongs to one state.",
    ),
    Spelling(
        "ReportGCP",
        "report-gcp",
        "compares measures with the projections of control points",
        (
            Form((IMAGES, "POINTS", "ORIENTATION"), in_order(0, 1, 1, 2)),
            Form((IMAGES, "POINTS", "MEASURES", "ORIENTATION"), in_order(0, 1, 2, 3)),
        ),
        example='ReportGCP ".*.jpg" GND Adjusted',
        differs="Points in another system than the orientation are converted, and that is told.",
    ),
    Spelling(
        "GenCodeSymDer",
        "gencode",
        "writes the compiled form of the equations anew",
        (Form((), in_order()), Form(("NAME",), in_order(0))),
        example="GenCodeSymDer",
    ),
    Spelling(
        "Bench",
        "check-derivatives",
        "runs the checks of derivatives of all formulas",
        (Form((), in_order()), Form(("LEVEL",), in_order())),
        example="Bench 1",
        differs="The other self checks are the tests of the project: tools/test.",
    ),
    *TARGETS,
)
"""All of them, in the order of the training."""

BY_NAME = {spelling.name: spelling for spelling in SPELLINGS}
