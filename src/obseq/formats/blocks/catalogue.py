"""Blocks of other programs: an option of `obseq bundle` each, what it takes, what reads it.

A line here is all that a format needs to be known by the command and its help. A reader is loaded when it is
asked for.
"""

from __future__ import annotations

from enum import Enum
from importlib import import_module
from typing import TYPE_CHECKING, Any

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.block import Block
    from obseq.images.bundle import BundleAdjustment


class Sigmas(Enum):
    """What files say of how good image points are.

    `NONE`: nothing: one pixel unless the user says it. `ALL`: it of every one. `SOME`: it of most, or of all
    together; the reader takes a sigma for the rest. `ASKED`: nothing, and the user must say it.
    """

    NONE = "none"
    ALL = "all"
    SOME = "some"
    ASKED = "asked"


@dataclass(frozen=True)
class BlockFormat:
    """A format of blocks.

    Attributes:
        option: of the command, without dashes.
        takes: `FILE` or `DIR`.
        holds: what it is, for people.
        reader: module and function, which takes a path.
        sigmas: what its files say of image points.
        options: of the command that the reader takes, by the name of its argument.
    """

    option: str
    takes: str
    holds: str
    reader: str
    sigmas: Sigmas = Sigmas.NONE
    options: tuple[tuple[str, str], ...] = ()

    def read(self, path: Path, given: Mapping[str, Any]) -> BundleAdjustment:
        """The block of a file or folder, with options of the command."""
        module, _, name = self.reader.partition(":")
        reader = getattr(import_module(f"obseq.{module}"), name)
        chosen = {argument: given[option] for argument, option in self.options if given[option] is not None}
        found = reader(path, **chosen)
        block: BundleAdjustment = found[0] if isinstance(found, tuple) else found
        return block


@dataclass(frozen=True)
class BlockWriter:
    """A format that adjusted blocks are written in.

    Attributes:
        option: of the command, without dashes.
        takes: `FILE` or `DIR`.
        holds: what it is, for people.
        module: with `check_block`, which refuses blocks that the format cannot hold before their adjustment,
            and a function that gives the texts of the files.
        function: its name; it takes a solution and a place.
        names: files of a folder that there are in any case.
    """

    option: str
    takes: str
    holds: str
    module: str
    function: str
    names: tuple[str, ...] = ()

    def check(self, block: Block) -> None:
        """Refuses a block that the format cannot hold."""
        import_module(f"obseq.{self.module}").check_block(block)

    def files(self, solution: BundleSolution, place: Path) -> dict[Path, str]:
        """The texts of the files of a solution."""
        return dict(getattr(import_module(f"obseq.{self.module}"), self.function)(solution, place))

    def places(self, place: Path) -> list[Path]:
        """Files that there will be in any case."""
        return [place / name for name in self.names] or [place]


IMAGE_SIGMA = ("image_sigma", "image_sigma")
BLOCKS = (
    BlockFormat("bal", "FILE", "a problem of Bundle Adjustment in the Large", "formats.bal.reader:read_bal"),
    BlockFormat("bundler", "FILE", "a bundle.out of Bundler", "formats.bundler.reader:read_bundler"),
    BlockFormat(
        "colmap", "DIR", "a sparse model of COLMAP, text or binary", "formats.colmap.reader:read_colmap"
    ),
    BlockFormat(
        "metashape",
        "FILE",
        "cameras and markers of Metashape (XML), or a project (.psx, .psz)",
        "formats.metashape.reader:read_metashape",
        Sigmas.SOME,
        (("chunk", "chunk"), IMAGE_SIGMA, ("control_sigma", "control_sigma")),
    ),
    BlockFormat("dbat", "FILE", "a script of DBAT (XML)", "formats.dbat.reader:read_dbat", Sigmas.ALL),
    BlockFormat(
        "photomodeler",
        "FILE",
        "a text export of PhotoModeler",
        "formats.photomodeler.reader:read_photomodeler",
        Sigmas.SOME,
        (("size", "size"), ("mark_sigma", "image_sigma")),
    ),
    BlockFormat(
        "aicon",
        "DIR",
        "files of AICON 3D Studio (needs --image-sigma)",
        "formats.aicon.reader:read_aicon",
        Sigmas.ASKED,
        (IMAGE_SIGMA,),
    ),
    BlockFormat(
        "micmac",
        "DIR",
        "a folder of orientations of MicMac v1, with --micmac-measures and --micmac-points",
        "project:read_v1_block",
        Sigmas.SOME,
        (("measures", "micmac_measures"), ("points", "micmac_points"), IMAGE_SIGMA),
    ),
    BlockFormat(
        "opensfm",
        "DIR",
        "a reconstruction of OpenSfM or ODM, with its tracks, gcp_list.txt and geo.txt",
        "formats.opensfm.reader:read_opensfm",
    ),
    BlockFormat(
        "pix4d",
        "FILE",
        "calibrated camera parameters of Pix4D, with --measures",
        "formats.pix4d.reader:read_pix4d",
    ),
    BlockFormat("nvm", "FILE", "a model of VisualSFM", "formats.nvm.reader:read_nvm"),
    BlockFormat("openmvg", "FILE", "a scene of OpenMVG (.json)", "formats.openmvg.reader:read_openmvg"),
    BlockFormat(
        "meshroom", "FILE", "a scene of Meshroom (.sfm, .json)", "formats.meshroom.reader:read_meshroom"
    ),
)

WRITERS = (
    BlockWriter(
        "colmap-out",
        "DIR",
        "a sparse model of COLMAP, as text",
        "formats.colmap.reader",
        "colmap_files",
        ("cameras.txt", "images.txt", "points3D.txt"),
    ),
    BlockWriter(
        "opensfm-out",
        "DIR",
        "a reconstruction of OpenSfM, and its tracks",
        "formats.opensfm.writer",
        "opensfm_files",
        ("reconstruction.json", "tracks.csv"),
    ),
    BlockWriter(
        "metashape-out",
        "FILE",
        "cameras and markers of Metashape (XML)",
        "formats.metashape.writer",
        "metashape_files",
    ),
    BlockWriter(
        "micmac-out",
        "DIR",
        "a folder of orientations of MicMac v1, measures and points in it",
        "project.micmac_v1_writer",
        "v1_files",
        ("Measures-S2D.xml", "Points-S3D.xml"),
    ),
    BlockWriter(
        "mmvii-out",
        "DIR",
        "a project of MMVII: orientations, measures and points, called Obseq",
        "project.block_writer",
        "mmvii_files",
        ("MMVII-PhgrProj/ObjCoordWorld/Obseq/MesGCP-Obseq.xml",),
    ),
    BlockWriter("opk-out", "FILE", "poses: omega, phi, kappa", "formats.opk.reader", "opk_files"),
    BlockWriter(
        "bal-out", "FILE", "a problem of Bundle Adjustment in the Large", "formats.bal.reader", "bal_files"
    ),
)
