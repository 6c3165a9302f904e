"""The commands of MMVII on instrument blocks and clinometers; see `spelling`."""

from __future__ import annotations

from obseq.errors import InputError
from obseq.project.options.option_values import Value
from obseq.project.options.spelling import Form, Option, Spelling, in_order, switch, value, values

NAME = Option("NameBloc", "of the block (TheBlock)", value("--name"))


def _right_angles(name: str, given: Value) -> list[str]:
    """Lists of two clinometers and a sigma."""
    words: list[str] = []
    for row in given if isinstance(given, list) else [given]:
        if not isinstance(row, list) or len(row) != 3:
            raise InputError(f"{name}=[[clinometer,clinometer,sigma],...]")
        words += ["--right-angle", *map(str, row)]
    return words


INSTRUMENTS = (
    Spelling(
        "ImportMeasuresClino",
        "import-clinometers",
        "imports readings of clinometers from a text file",
        (Form(("FILE", "FORMAT", "OUT"), in_order(0, 1, 2)),),
        (
            Option("NumL0", "first line that is read, from 0", value("--first-line")),
            Option("Comment", "what begins a comment", value("--comment")),
            Option("NbDig", "digits of identifiers that are numbers", value("--digits")),
        ),
        "ImportMeasuresClino tilts.txt ImNANA Tilts",
        "Angles may be gon or degrees (--unit of obseq import-clinometers).",
    ),
    Spelling(
        "BlockInstrEdit",
        "edit-instruments",
        "names the cameras and clinometers of a body",
        (Form(("BLOCK",), in_order(0)),),
        (
            NAME,
            Option("PatsIm4Cam", "[images, exposure?, images used?]", values("--cameras")),
            Option("InMeasureClino", "folder of readings: its clinometers", value("--readings")),
            Option("CstrOrthog", "[[clinometer, clinometer, sigma],...]", _right_angles),
            Option("FromScratch", "1: forgets the file that is there", switch("--from-scratch")),
            Option("OutInstrBlock", "folder that is written", value("--out")),
        ),
        "BlockInstrEdit B0 PatsIm4Cam=['.*_(.*).JPG'] InMeasureClino=Tilts",
    ),
    Spelling(
        "BlockInstrInitCam",
        "init-cameras",
        "finds the places of the cameras of a body",
        (Form(("IMAGES", "BLOCK", "ORIENTATION", "OUT"), in_order(0, 1, 2, 3)),),
        (NAME,),
        "BlockInstrInitCam '.*JPG' B0 BA B1",
    ),
    Spelling(
        "BlockInstrInitClino",
        "init-clinometers",
        "finds the axes of the clinometers of a body",
        (Form(("IMAGES", "BLOCK", "ORIENTATION", "READINGS", "OUT"), in_order(0, 1, 2, 3, 4)),),
        (NAME,),
        "BlockInstrInitClino '.*JPG' B1 BA Tilts B2",
        "Axes are those of least squares, not the best of a grid.",
    ),
    Spelling(
        "ClinoInit",
        "init-boresights",
        "finds clinometers on a camera, as they were before blocks",
        (Form(("READINGS", "CLINOMETERS", "ORIENTATION", "OUT"), in_order(0, 1, 2, 3)),),
        (
            Option("Type", "Spring (as is usual) or Pendulum", value("--type")),
            Option(
                "Rel12", "axes of the second clinometer in the frame of the first (i-kj)", value("--second")
            ),
            Option("PatFilter", "of the exposures that are used", value("--exposures")),
            Option("OkNoCam", "1: exposures without an image are left aside", switch("--others")),
        ),
        "ClinoInit Tilts [0,1] BA Boresights Type=Pendulum",
        "Boresights are those of least squares, from 24 starts, not the best of a grid.",
    ),
)
"""In the order in which they are typed."""
