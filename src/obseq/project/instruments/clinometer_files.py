"""Readings of clinometers from text files, and the files of a project that hold them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from obseq.errors import InputError
from obseq.images.names import unique_names
from obseq.project.instruments.blocks import ClinometerReadings
from obseq.project.tree import Tree, data_text
from obseq.reading.text import read_bytes

FILE = "ClinoMeasures"


def read_lines(
    path: Path, form: str, *, factor: float = 1.0, first: int = 0, comment: str = "#", digits: int = 0
) -> ClinometerReadings:
    """Readings of a text file, a line for each exposure.

    Args:
        path: of the file.
        form: fields of a line: Im (the exposure), and for each clinometer N (its name), A (its angle) and S
            (the sigma of that), N and S where they are there; clinometers without names are called 0, 1, ...
        factor: radians in the unit of the file.
        first: lines before are left out.
        comment: what begins a comment.
        digits: identifiers that are numbers get zeros before, to so many.

    Raises:
        InputError: with the line, or what is wrong with the form.
    """
    fields = re.findall(r"Im|[NAS]", form)
    count = fields.count("A")
    if "".join(fields) != form or fields.count("Im") != 1 or not count:
        raise InputError(f"{form!r} is no format of readings: ImNANA, ImAASS and so on")
    if any(fields.count(name) not in (0, count) for name in "NS"):
        raise InputError(f"{form!r}: each of the {count} clinometers has a name and a sigma, or none has")
    names: list[str] = []
    exposures: list[str] = []
    angles: list[list[float]] = []
    sigmas: list[list[float]] = []
    for number, line in enumerate(read_bytes(path).decode("utf-8", "replace").splitlines()):
        words = (line.partition(comment)[0] if comment else line).split()
        if number < first or not words:
            continue
        where = f"{path}:{number + 1}"
        if len(words) < len(fields):
            raise InputError(f"{where}: has {len(words)} fields; {form} takes {len(fields)}")
        of: dict[str, list[str]] = {kind: [] for kind in ("Im", *"NAS")}
        for word, kind in zip(words, fields, strict=False):
            of[kind].append(word)
        own = of["N"] or [str(k) for k in range(count)]
        names = names or own
        if own != names:
            raise InputError(f"{where}: has the clinometers {' '.join(own)}; before, {' '.join(names)}")
        exposure = of["Im"][0]
        exposures.append(exposure.zfill(digits) if exposure.isdigit() else exposure)
        angles.append(_numbers(of["A"], factor, where))
        sigmas.append(_numbers(of["S"], factor, where) or [float("nan")] * count)
    if not exposures:
        raise InputError(f"{path}: holds no readings")
    unique_names(tuple(names), f"{path}: clinometer")
    unique_names(tuple(exposures), f"{path}: exposure")
    return ClinometerReadings(path, tuple(names), tuple(exposures), np.array(angles), np.array(sigmas))


def _numbers(words: list[str], factor: float, where: str) -> list[float]:
    try:
        found = [factor * float(word) for word in words]
    except ValueError as error:
        raise InputError(f"{where}: {error}") from None
    if not np.isfinite(found).all():
        raise InputError(f"{where}: an angle or a sigma is not finite")
    return found


def readings_text(found: ClinometerReadings, *, as_json: bool = False) -> str:
    """The file of readings."""
    rows: list[Tree] = []
    for exposure, angles, sigmas in zip(found.exposures, found.angles, found.sigmas, strict=True):
        row: dict[str, Tree] = {"Ident": exposure, "Angles": [(float(angle),) for angle in angles]}
        if np.isfinite(sigmas).all():
            row["Sigmas"] = [(float(sigma),) for sigma in sigmas]
        rows.append(row)
    return data_text({"NamesClino": list(found.names), "SetMeasures": rows}, as_json=as_json)
