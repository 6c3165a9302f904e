"""The commands of MMVII on coded targets; see `spelling`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from obseq.errors import InputError
from obseq.project.options.option_values import Value, number_at
from obseq.project.options.spelling import Form, Option, Spelling, in_order, switch, value, values

PARITIES = {"1": "odd", "2": "even", "3": "all"}
IMAGES = "IMAGES"


def _parity(name: str, given: Value) -> list[str]:
    if not isinstance(given, str) or given not in PARITIES:
        raise InputError(f"{name} is 1 (odd), 2 (even) or 3 (all)")
    return [f"--parity={PARITIES[given]}"]


def _self_symmetric(name: str, given: Value) -> list[str]:
    return switch("--no-half-turns")(name, {"0": "1", "false": "1"}.get(str(given), "0"))


def _angle(name: str, given: Value) -> list[str]:
    return [f"--angle={math.degrees(number_at([given], 0, name))}"]


def _drawn(name: str, given: Value) -> list[str]:
    return [] if given in ("0", "-1") else ["--overlay"]


def _with(*more: str) -> Callable[[Sequence[str]], list[str]]:
    """Images and specification, and options of ours that belong to the command."""
    return lambda given: [given[0], given[1], *more]


def _with_geometry(name: str, given: Value) -> list[str]:
    raise InputError(f"{name}: circles are taken as horizontal; only spots at their points get names")


def _idle(options: dict[str, str]) -> list[Option]:
    """Options that are accepted and do nothing, with what they are."""
    return [
        Option(name, f"{what}, not needed here", lambda name, given: []) for name, what in options.items()
    ]


def _extracting(name: str, about: str, more: tuple[str, ...], idle: dict[str, str], example: str) -> Spelling:
    return Spelling(
        name,
        "extract-targets",
        about,
        (Form((IMAGES, "SPECIFICATION"), _with(*more)),),
        (
            Option("OutPointsMeasure", "folder of the measures (Std)", value("--out")),
            Option("OutObjMesInstr", "the same, as it is called since 2025", value("--out")),
            Option("Restrict", "pattern of the names that are kept", value("--only")),
            Option("ZoomVisuEllipse", "draws what was found, in VISU", _drawn),
            Option("ZoomVisuLabel", "the same", _drawn),
            *_idle(idle),
        ),
        example,
        "Places are those of least squares of the drawing: true centres, with their variances.",
    )


TARGETS = (
    Spelling(
        "CodedTargetGenerateEncoding",
        "targets generate",
        "makes the codes of a family",
        (
            Form(("TYPE",), in_order(0)),
            Form(("TYPE", "BITS"), lambda given: [given[0], f"--bits={given[1]}"]),
        ),
        (
            Option("NbBits", "length of the codes", value("--bits")),
            Option("NbB", "the same", value("--bits")),
            Option("MinHamD", "bits in which codes differ", value("--distance")),
            Option("MaxRunL", "longest runs of zeros and of ones", values("--runs")),
            Option("FreqCircEq", "how many turns look alike", value("--frequency")),
            Option("Parity", "1 odd, 2 even, 3 all", _parity),
            Option("MaxNb", "codes at most", value("--most")),
            Option("Base4N", "of the numbers in names", value("--base")),
            Option("NbDig", "digits of these numbers", value("--digits")),
            Option("TargetNamePrefix", "what names begin with", value("--before")),
            Option("OkSelfSym", "0: no codes that look the same when turned", _self_symmetric),
        ),
        "CodedTargetGenerateEncoding CERN NbBits=14",
        "The full specification is written too. Sets are those of before 2024, with more codes.",
    ),
    Spelling(
        "CodedTargetGenerate",
        "targets draw",
        "draws targets",
        (Form(("ENCODING",), lambda given: [given[0], "--format", "png"]),),
        (
            Option("PatIm", "pattern of the names that are drawn", value("--names")),
            Option("ThW0", "width inside of the code, over the figure's radius", value("--inside")),
            Option("ThCod", "width of the code", value("--code")),
            Option("ThSepCar", "width from the code to the legend", value("--outside")),
            Option("ThBExt", "width from the legend to the end of the sheet", value("--border")),
            Option("Theta", "where chequers and bits begin, radians", _angle),
            *_idle({"ThCar": "size of letters, which are fitted", "ZoomShow": "a drawing"}),
        ),
        "CodedTargetGenerate CERN_Nbb14_Freq14_Hamm1_Run1000_1000_SpecEncoding.xml PatIm=00.",
        "The geometry is that of the file, or of the family; its specification is written anew.",
    ),
    _extracting(
        "CodedTargetExtract",
        "finds and measures chequered targets",
        (),
        {
            "DMD": "least diameter",
            "CC": "which centre",
            "Adjust": "a second step",
            "Margin": "part of an edge that is left out",
            "Tolerance": "of places of bits",
            "LinedUpPx": "straightness of edges",
            "MaxEcc": "largest tilt",
            "Saddle": "another first step",
            "RayTF": "radii of a filter",
            "BinF": "a filter",
        },
        "CodedTargetExtract '.*JPG' IGNIndoor_Nbb12_Freq2_Hamm3_Run2_3_FullSpecif.xml "
        "OutPointsMeasure=TargetsI",
    ),
    _extracting(
        "CodedTargetCircExtract",
        "finds and measures ring targets, and spots without code",
        ("--uncoded", "--attributes"),
        {
            "DiamMin": "least diameter",
            "DiamMax": "greatest diameter",
            "RDMML": "of a filter",
            "StepRefineGrad": "step of a refinement",
            "ZoomVisuSeed": "a drawing",
        },
        "CodedTargetCircExtract '.*JPG' CERN_Nbb14_Freq14_Hamm1_Run1000_1000_FullSpecif.xml "
        "OutPointsMeasure=TargetsC",
    ),
    Spelling(
        "CodedTargetSimul",
        "simulate-targets",
        "puts targets into images, at places that are written",
        (Form((IMAGES, "SPECIFICATION"), in_order(0, 1)),),
        (
            Option("OutPointsMeasure", "folder of the measures (Simul)", value("--out")),
            Option("OutObjMesInstr", "the same, as it is called since 2025", value("--out")),
            Option("Radius", "least and greatest half side, pixels", values("--radius")),
            Option("Ratio", "of the sides, as they are seen", values("--ratio")),
            Option("PatNames", "pattern of the names", value("--names")),
            Option("NoiseAmpl", "noise, over 128 grey levels", values("--noise")),
            Option("PropLinBias", "change of the light", values("--ramp")),
            Option("ContrastAtten", "loss of contrast", values("--grey")),
            Option("MulAtten", "loss of light", values("--dark")),
            Option("SuplPref", "after SimulTarget_ in names", value("--prefix")),
            *_idle(
                {"SzK": "size of a kernel", "Border": "margin of the image", "AmplHomogDef": "perspective"}
            ),
        ),
        "CodedTargetSimul '.*tif' CERN_Nbb14_Freq14_Hamm1_Run1000_1000_FullSpecif.xml Radius=[20,50]",
        "Targets are seen in perspective by a camera, with blur; those that find no place are named.",
    ),
    Spelling(
        "CodedTargetCompleteUncoded",
        "complete-targets",
        "names targets without a code",
        (
            Form(
                (IMAGES, "ORIENTATION", "THRESHOLD", "POINTS", "MEASURES", "OUT"),
                lambda given: [*(given[k] for k in (0, 1, 3, 4, 5)), f"--within={given[2]}"],
            ),
        ),
        (
            Option("ThRay", "what an ellipse must be on its plane", _with_geometry),
            Option("PatNorm", "points whose plane it is", _with_geometry),
        ),
        "CodedTargetCompleteUncoded '.*_Scaled.tif' BA 1.0 Std Std Completed",
        "A spot and a point must each be the nearest to the other.",
    ),
    Spelling(
        "CodedTargetRefineCirc",
        "refine-circles",
        "refines the centres of circles",
        (
            Form((IMAGES, "MEASURES", "POINTS", "ORIENTATION"), lambda given: [*given, "Refined"]),
            Form((IMAGES, "MEASURES", "POINTS", "ORIENTATION", "OUT"), in_order(0, 1, 2, 3, 4)),
        ),
        (Option("RayTarget", "radius of the circles", value("--radius")),),
        "CodedTargetRefineCirc '.*JPG' Completed Std BA",
        "Only centres of ellipses are changed: those of coded targets are true already.",
    ),
)
"""In the order of the training."""
