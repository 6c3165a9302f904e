"""`obseq bundle-adjust`: MMVII's `OriBundleAdj` on a project tree, with its options as it writes them."""

import argparse
from functools import partial
from pathlib import Path

from msgspec import structs

from obseq.boundary import Boundary
from obseq.cli.parsing import Commands, add_command, output_file
from obseq.cli.progress import Progress
from obseq.cli.results import INCOMPLETE, add_detail, detail_of, show
from obseq.stopwatch import Stopwatch
from obseq.writing import check_writable, write_all

MORE = """
Options are MMVII's, Name=value, of today or of 2024:
  GCP3D=[[F,SG,Out?],...] GCP2D=[[F,SI,At?,Thr?,Exp?],...]   or GCPDir, GCPW, AddGCPW, GCPDirOut
    SI is a sigma in pixels; 0: the covariances of the files of measures
  PPFzCal=Pat PPFreeCal=[[Cam,Par,Weight?],...] SharedIP=[Cam,Par,...] PatFzCenters PatFzOrient
  PoseVisc=[C,R] RefOri=[Ori,C,R?,Pat?] TPDir=F TiePWeight=[S,At?,Thr?,Exp?] NbIter=N
  TopoDirIn=F TopoDirOut=F TopoW=W (weights of the survey, times W) TopoRefr=k (refraction coefficient)
  GCPFilter=Pat GCPFilterAdd=Pat (3D points by name, by additional information)
  BRDirIn=F BRW=[Tr,Rot] BRW_Rat=[Tr,Rot] OutRigBlock=F
  BOI=[[Block,mTr,mRot,Save,Rel],[gTr,gRot],[cTr,cRot]] InInstrBlock=F OutInstrBlock=F
  ClinoBOI=[[Block,mAng,mOrth],[VertFree,Others],[Degree0,Degree1,...]] InMeasureClino=F
  ClinoDirIn=F InMeasureClino=F ClinoDirOut=F (clinometers of ClinoInit, without a block)
The iterations go on until they converge; NbIter only limits them. Poses, calibrations and points that
are written belong to one state."""

EXAMPLE = """\
example:
  obseq bundle-adjust '.*' Resec BA 'GCP3D=[[Fil,1,Adjusted]]' 'GCP2D=[[Fil,0.5]]' \\
      BRDirIn=Rig 'BRW=[1e-2,1e-5]'

exit code: 0 adjusted; 1 not converged, something left out, or a gross error suspected; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "adjust a block of a project tree (MMVII's OriBundleAdj)"
    command = add_command(commands, "bundle-adjust", run, purpose, MORE, EXAMPLE)
    command.add_argument("images", help="a regular expression of image names, or a list (SetOfName file)")
    command.add_argument("orientation", help="folder of orientations to start from (Ori)")
    command.add_argument("out", help="folder of orientations that is written")
    command.add_argument("options", nargs="*", metavar="NAME=VALUE", help="MMVII's options")
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR", help="that holds MMVII-PhgrProj (here)"
    )
    command.add_argument("--json-files", action="store_true", help="write JSON instead of XML")
    command.add_argument("--json", type=output_file, metavar="FILE", help="every result at full precision")
    command.add_argument("--html", type=output_file, metavar="FILE", help="a page with drawings of the block")
    command.add_argument("--ply", type=output_file, metavar="FILE", help="points and cameras for a viewer")
    add_detail(command)


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    from obseq.project.layout import ProjectTree
    from obseq.project.options.bundle_options import parse_options

    options, tree = parse_options(arguments.options), ProjectTree.at(arguments.project)
    reports = [path for path in (arguments.json, arguments.html, arguments.ply) if path]
    check_writable(reports)
    detail = detail_of(arguments, "block")
    with Progress("reading") as progress:
        watch = Stopwatch(progress)
        from obseq.images.diagnosing.diagnosis import diagnosed
        from obseq.images.diagnosing.refusals import explained
        from obseq.images.output.clouds import ply
        from obseq.images.output.page import outcome, page
        from obseq.images.output.record import record_of
        from obseq.project.assembly import assembled
        from obseq.project.results import Results

        with watch.phase("read"), watch.counted("read"):
            block = assembled(tree, arguments.images, arguments.orientation, options)
        with explained(block, progress, max_iterations=options.iterations), watch.phase("adjust"):
            solution = block.solve(
                max_iterations=options.iterations,
                progress=lambda step: progress(f"adjusting: {step}"),
            )
        boundary, limit = Boundary(), options.iterations
        search = partial(diagnosed, solution, block.poses, progress, max_iterations=limit)
        with watch.phase("search for errors"):
            diagnosis = boundary.attempt("the search for errors", search, None, ends=True)
        record = record_of(solution, diagnosis=diagnosis, failures=boundary.failures)
        results = Results(tree, options, arguments.orientation, arguments.out, arguments.json_files)
        writers = {
            arguments.json: record.to_json,
            arguments.html: lambda: page(record),
            arguments.ply: lambda: ply(solution),
        }
        boundary = Boundary()
        with watch.phase("write"):
            files = boundary.texts({path: writers[path] for path in reports}) | results.files(solution)
            record = structs.replace(record, failures=(*record.failures, *boundary.failures))
            check_writable(files)
            write_all(files)
    written = [tree.folder("Ori", arguments.out), *reports]
    show(outcome(record), written, detail, watch.seconds)
    return 0 if record.is_complete else INCOMPLETE
