"""Command files of SNAP (`.snp`): which files make a network, what is held, and how it is adjusted."""

from __future__ import annotations

import fnmatch
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import field
from pathlib import Path

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.includes import DEEPEST, Folder
from obseq.formats.snap.stations import Mark, read_marks
from obseq.formats.snap.systems import System
from obseq.reading.text import TextFile, quoted, read_text

REFRACTION = 0.075
"""Coefficient of SNAP where no command says another; ours is twice as large."""
FLOAT = 1.0
"""Standard error (m) of floated stations where no command says another."""
QUIET = (
    *("title", "list", "print", "plot", "output", "output_csv", "output_coordinate_file", "output_precision"),
    *("add_residual_column", "define_residual_format", "summarize_errors_by", "summarise_errors_by"),
    *(
        "summarize_residuals_by",
        "summarise_residuals_by",
        "reorder_stations",
        "sort_observations",
        "error_type",
    ),
    *("flag_significance", "mde_power", "number_of_worst_residuals", "redundancy_flag_level", "topocentre"),
    *(
        "coordinate_precision",
        "file_location_frequency",
        "min_iterations",
        "max_iterations",
        "max_adjustment",
    ),
    *(
        "convergence_tolerance",
        "use_zero_inverse",
        "specification",
        "test_specification",
        "spec_test_options",
    ),
    *("station_code_width", "ignore_missing_stations", "configuration"),
)
"""Commands that change nothing of what is adjusted, or not more than the end of its iterations."""
DIMENSIONS = {"3d": (False, False), "2d": (False, True), "horizontal": (False, True)}
DIMENSIONS |= {"1d": (True, False), "vertical": (True, False)}
"""Whether plan and height of all stations are held."""
STATES = ("fix", "float", "free")
PARTS = {"horizontal": (True, False), "vertical": (False, True), "3d": (True, True)}
WITH_VALUES = ("bearing_orientation_error", "distance_scale_error", "reference_frame", "systematic_error")
"""Commands that name parameters of observations."""
CHANGES = {"ignore_observations": 0.0, "reject_observations": math.inf, "reweight_observations": math.nan}
"""What becomes of standard errors; NaN for a factor in the command."""
_RANGE = re.compile(r"(.+)-(.+)")


@dataclass(frozen=True)
class Command:
    """A command: its file and line (from 0), and its words, the first in small letters."""

    file: TextFile
    index: int
    words: tuple[str, ...]

    def error(self, problem: str) -> InputError:
        """An error about it."""
        return self.file.error(self.index, f"{self.words[0]}: {problem}")

    def number(self, at: int) -> float:
        """A number among its words."""
        if at >= len(self.words):
            raise self.error("a number is missing")
        return self.file.number(self.index, self.words[at])


@dataclass(frozen=True)
class Hold:
    """How a station takes part.

    Attributes:
        fixed: Whether plan and height are held.
        floated: Standard errors (m) of plan and height as observations; 0 for none.
    """

    fixed: tuple[bool, bool] = (False, False)
    floated: tuple[float, float] = (0.0, 0.0)


@dataclass
class Job:
    """What a command file says.

    Attributes:
        folder: Of its files.
        system: Of the first coordinate file.
        marks: All stations by code.
        files: Data files, and the factor of their standard errors.
        held: How stations take part; those that are not named are free.
        dropped: Stations that are rejected or ignored.
        everything: Whether plan and height of all stations are held, by the mode.
        is_free: Whether inner constraints are asked for.
        refractions: Coefficients by name in small letters, of SNAP.
        modelled: Frames and errors with parameters, by command and name in small letters, and where.
        ignores_missing: Whether observations of unknown stations are left out.
        changes: Data types, and the factor of their standard errors: 0 leaves observations out, an infinite
            one switches them off.
        told: What a user should know.
    """

    folder: Folder
    system: System | None = None
    marks: dict[str, Mark] = field(default_factory=dict)
    files: list[tuple[Path, float]] = field(default_factory=list)
    held: dict[str, Hold] = field(default_factory=dict)
    dropped: set[str] = field(default_factory=set)
    everything: tuple[bool, bool] = (False, False)
    is_free: bool = False
    refractions: dict[str, float] = field(default_factory=lambda: {"default": REFRACTION, "zero": 0.0})
    modelled: dict[tuple[str, str], Command] = field(default_factory=dict)
    ignores_missing: bool = False
    changes: list[tuple[frozenset[str], float]] = field(default_factory=list)
    told: list[str] = field(default_factory=list)


def read_commands(path: Path, folder: Folder) -> Job:
    """Reads a command file with those that it includes, and the coordinate files that it names.

    Raises:
        InputError: A command is unknown, or changes the adjustment in a way that nothing here does.
    """
    job, later = Job(folder), []
    sizes = [FLOAT, FLOAT]
    for command in _commands(path, folder):
        word = command.words[0]
        if word in ("horizontal_float_error", "vertical_float_error"):
            sizes[word[0] == "v"] = command.number(1)
        elif word in (*STATES, "reject", "ignore", "accept"):
            later.append((command, tuple(sizes)))
        elif word == "ignore_missing_stations":
            job.ignores_missing = command.words[1:2] != ("off",)
        elif word not in QUIET:
            _take(job, command)
    if job.system is None or not job.files:
        raise read_text(path, folder.encoding).error(0, "no coordinate_file, or no data_file, is named")
    for command, (plan, height) in later:
        _hold(job, command, (plan, height))
    return job


def _commands(path: Path, folder: Folder, depth: int = 0) -> Iterator[Command]:
    file = read_text(path, folder.encoding)
    for index, line in enumerate(file.lines):
        words = line.partition("!")[0].split()
        if not words:
            continue
        command = Command(file, index, (words[0].lower(), *words[1:]))
        if command.words[0] != "include":
            yield command
        elif len(words) != 2 or depth == DEEPEST:
            raise command.error(f"it names one file, {DEEPEST} levels deep at most; is there a loop?")
        else:
            yield from _commands(folder.path(words[1], path.parent), folder, depth + 1)


def _take(job: Job, command: Command) -> None:
    """Takes a command that is neither about stations nor without effect."""
    word, *rest = command.words
    small = [text.lower() for text in rest]
    if word == "coordinate_file":
        _coordinates(job, command)
    elif word == "data_file":
        _data_file(job, command)
    elif word == "mode":
        _mode(job, command, small)
    elif word == "default_refraction_coefficient":
        job.refractions["default"] = command.number(1)
    elif word == "refraction_coefficient":
        if "calculate" in small or "?" in small or len(small) < 2:
            raise command.error("coefficients are asked for with --estimate refraction; give a value here")
        job.refractions[small[0]] = command.number(2)
    elif word in WITH_VALUES:
        name = next((text for text in small if text not in ("use", "calculate", "topocentric")), "")
        job.modelled[word, name] = command
    elif word == "deformation" and small != ["none"]:
        job.told.append(f"{command.file.place(command.index)}: deformation is not applied: {' '.join(rest)}")
    elif word in CHANGES or small[:2] == ["data_type", "ignore"]:
        _change(job, command, small)
    elif word != "deformation":
        raise command.error(
            f"{quoted(' '.join(rest))}: nothing here does that; remove it, or use another way"
        )


def _path(job: Job, command: Command) -> Path:
    if len(command.words) < 2:
        raise command.error("it names no file")
    return job.folder.path(command.words[1])


def _coordinates(job: Job, command: Command) -> None:
    path = _path(job, command)
    if len(command.words) > 2:
        raise command.error(
            "only coordinate files in the form of SNAP (.crd) are read; write it so (snapconv)"
        )
    system, marks = read_marks(path, job.folder.encoding)
    if job.system is not None and system.definition != job.system.definition:
        raise command.error(f"{path} has another datum than the first coordinate file")
    job.system = job.system or system
    for mark in marks:
        first = job.marks.setdefault(mark.name, mark)
        if first is not mark and first.place.file == mark.place.file:
            raise mark.place.error(f"station {mark.name} is given twice (first in line {first.place.line})")


def _data_file(job: Job, command: Command) -> None:
    rest = [text.lower() for text in command.words[2:]]
    factor = 1.0
    if rest[:1] == ["error_factor"]:
        factor = command.number(3)
        rest = rest[2:]
    if rest:
        raise command.error(
            f"{' '.join(rest)}: data files in the form of SNAP are read; SINEX files are adjusted by "
            "themselves, tables as .csv with the columns of obseq"
        )
    job.files.append((_path(job, command), factor))


def _mode(job: Job, command: Command, words: Sequence[str]) -> None:
    for word in words:
        if word in DIMENSIONS:
            job.everything = DIMENSIONS[word]
        elif word == "data_check":
            job.everything = (True, True)
        elif word.startswith("free_net"):
            job.is_free = True
        elif word == "network_analysis":
            job.told.append(f"{command.file.place(command.index)}: this is a plan: obseq plan computes it")
        elif word != "adjustment":
            raise command.error(
                f"{quoted(word)} is no mode ({', '.join(DIMENSIONS)}, adjustment, data_check)"
            )


def _change(job: Job, command: Command, words: list[str]) -> None:
    """Takes what is done with observations of some data types."""
    factor = CHANGES.get(command.words[0], 0.0)
    if math.isnan(factor):
        factor, words = command.number(1), words[1:]
    codes, rest = (words[2:3], words[3:]) if words[0] == "data_type" else (words[:1], words[1:])
    name, _, values = codes[0].lstrip("@").rpartition("=") if codes else ("", "", "")
    if rest or name not in ("", "data_type") or not values:
        raise command.error(
            "observations are chosen by data_type=HA/SD alone here; mark others by * in their files"
        )
    job.changes.append((frozenset(values.upper().split("/")), factor))


def _hold(job: Job, command: Command, floated: tuple[float, float]) -> None:
    """Applies a command about stations."""
    word, rest = command.words[0], list(command.words[1:])
    if rest and rest[0].lower().startswith("auto"):
        job.told.append(
            f"{command.file.place(command.index)}: what observations do not determine is left out and named"
        )
        return
    part = next((text for text in rest[:2] if text.lower() in PARTS and text not in job.marks), None)
    if part is not None:
        rest.remove(part)
    parts = PARTS.get(part.lower()) if part else None
    names = _listed(job, command, rest)
    if word not in STATES:
        job.dropped = job.dropped - names if word == "accept" else job.dropped | names
        return
    for name in names:
        old = job.held.get(name, Hold())
        chosen = parts or (True, True)
        fixed = [word == "fix" if is_new else was for is_new, was in zip(chosen, old.fixed, strict=True)]
        sizes = [
            (size if word == "float" else 0.0) if is_new else was
            for is_new, size, was in zip(chosen, floated, old.floated, strict=True)
        ]
        job.held[name] = Hold((fixed[0], fixed[1]), (sizes[0], sizes[1]))


def _listed(job: Job, command: Command, words: Sequence[str]) -> set[str]:
    """Codes of the stations of a list."""
    found: set[str] = set()
    for word in words:
        if word.lower() in ("and", "except", "inside", "outside"):
            raise command.error(f"a list with {word} is not read; name the stations")
        found |= _matching(job, command, word)
    return found


def _matching(job: Job, command: Command, word: str) -> set[str]:
    """Codes of the stations of one item of a list."""
    plain = word.removeprefix("\\")
    if plain in job.marks:
        return {plain}
    if word.lower() in ("all", "or", "ignore_missing", "warn_missing", "fail_missing"):
        return set(job.marks) if word.lower() == "all" else set()
    if word.startswith("@"):
        name = word[1:] if "." in word else f"{word[1:]}.stl"
        lines = job.folder.open(name).lines
        words = [item for line in lines if not line.startswith("!") for item in line.split()]
        return _listed(job, command, words)
    name, is_class, values = word.partition("=")
    if is_class:
        wanted = values.split("/")
        return {mark.name for mark in job.marks.values() if mark.classes.get(name.lower()) in wanted}
    if "*" in word or "?" in word:
        return set(fnmatch.filter(job.marks, word))
    ends = _RANGE.fullmatch(word)
    if ends is None:
        raise command.error(f"station {quoted(word)} is in no coordinate file")
    first, last = (_ordered(end) for end in ends.groups())
    return {code for code in job.marks if first <= _ordered(code) <= last}


def _ordered(code: str) -> tuple[int, str]:
    """What sorts codes: leading digits as a number, then the rest."""
    rest = code.lstrip("0123456789")
    return int(code[: len(code) - len(rest)] or 0), rest
