"""Write the table of what uses each formula, docs/formula-uses.md: `python tools/formula_uses.py`.

A formula is the equation of a kind of survey observations, or named in a module of the library, or shown in
an adjustment of the documentation; or it is a kernel only, with the reason. The tests hold that every formula
has a line, and that what a line says is so.
"""

import re
from pathlib import Path

from obseq.kernels import formula_names
from obseq.survey.kinds.registry import KINDS

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "formula-uses.md"
OFFSETS = "Off"
BLOCKS = "blocks of images, `BundleAdjustment`"

LIBRARY = (
    (r"EqColinearityCamPPC_(?!.*Backward).*", "images/camera.py", f"{BLOCKS}: image points"),
    (r"EqColinearityCamPPC_.*Backward.*", "images/camera.py", f"{BLOCKS}: image points, inverse distortion"),
    (r"EqColinearityRolling_.*", "images/adjustment/equations.py", f"{BLOCKS}: shutters that roll"),
    (r"AntennaPosition", "images/adjustment/reference_equations.py", f"{BLOCKS}: positions of an antenna"),
    (
        r"Clino_0_3|ClinoNeedle|VNormOrthog",
        "images/adjustment/reference_equations.py",
        f"{BLOCKS}: clinometers",
    ),
    (r"BlocRigid|RigidPair|KnownRotation", "images/adjustment/rigid_equations.py", f"{BLOCKS}: rigid blocks"),
    (r"Dist3D", "images/adjustment/equations.py", f"{BLOCKS}: scale bars"),
    (r"DeformImHomography", "targets/finding/measuring.py", "coded targets: their centres in images"),
    (r"Dir_.*", "images/camera.py", "cameras: directions to pixels"),
    (r"Inv_.*", "images/camera.py", "cameras: pixels to directions"),
    (r"EqDist_.*", "images/camera.py", "cameras: the distortion as a mapping"),
    (r"Dist_Polyn2D_.*", "images/epipolar/satellites.py", "epipolar residual of satellite images"),
)
"""Names, the module that calls them, and what for."""

SHOWN = (
    (r"EqLineProjCamPPC_.*", "equation-families.md", "EqLineProjCamPPC_", "lines"),
    (r"EqLidarLidar", "equation-families.md", "EqLidarLidar", "a scan against a scan"),
    (r"EqLidarIm.*", "equation-families.md", "EqLidarIm", "a scan against images"),
    (r"Radiom.*", "equation-families.md", "Radiom", "radiometric equalisation"),
    (r"(LGrad_)?DeformIm(Homotethy|Affinity)", "equation-families.md", "DeformIm", "image deformation"),
)
"""Names, the page with an adjustment, what stands there, and what it adjusts."""

KERNELS = (
    (
        r"BlocRigid_RE",
        "`BlocRigid` with the block's frame in its first camera; `RigidPair` says it in 6 residuals",
    ),
    (r"ClinoBloc", "two residuals of one reading; `ClinoNeedle` says it in one"),
    (r"ClinoRot", "the original keeps two clinometers together with it, to 40 degrees"),
    (r"BunleElem_.*", "two or three images without control; `resection` and `initialise` place them"),
    (
        r"cFormula_EqColinearity.*",
        "a camera whose model is outside of the formula; cameras here have formulas",
    ),
    (r"RPC_Transfo", "a mapping, no observation; aerial images compute it with their own polynomials"),
    (
        r"(Ratio)?Dist2DCons|PropCovNwCD_.*|SetPointNwCD_.*|SumSquare_.*",
        "plane networks of the original's own tests",
    ),
    (r"TopoSubFrame", "vectors along a frame; survey networks take their components as linear equations"),
    (r"TopoDHParam", "`TopoDHParamOff` with offsets of 0, which the survey takes"),
)
"""Names, and why nothing here adjusts with them; `obseq.Adjustment` takes them all."""


def surveyed() -> set[str]:
    """Equations of kinds of survey observations, with offsets of instrument and target and without."""
    known = set(formula_names())
    return {kind.equation(offsets) for kind in KINDS for offsets in ("", OFFSETS)} & known


def use(name: str) -> str:
    """What uses a formula, in words with a link; empty where nothing is known."""
    uses = ["survey networks ([kinds](survey-files.md))"] if name in surveyed() else []
    uses += [what for names, _, what in LIBRARY if re.fullmatch(names, name)]
    uses += [f"[{what}]({page})" for names, page, _, what in SHOWN if re.fullmatch(names, name)]
    reasons = [f"kernel only: {why}" for names, why in KERNELS if re.fullmatch(names, name)]
    return "; ".join(uses or reasons)


def page() -> str:
    """The text of the page."""
    rows = [f"| `{name}` | {use(name)} |" for name in formula_names()]
    head = (
        "# What uses each formula\n\n"
        "<!-- Written by tools/formula_uses.py; the tests hold it. -->\n\n"
        "Any of them can be put in an [open adjustment](one-adjustment.md) by its name. (Reference.)\n\n"
        "| formula | used by |\n|---|---|\n"
    )
    return head + "\n".join(rows) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
