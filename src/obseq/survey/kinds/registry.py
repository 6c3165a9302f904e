"""The kinds of observations there are. A new one is an object of its own, a line here, and its formula."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from obseq.errors import InputError
from obseq.kernels import Kernel, load
from obseq.survey.kinds.axes import AXIS_LINK, AXIS_PLANE, AXIS_RADIUS
from obseq.survey.kinds.calibrated import (
    DIST_CONSTANT,
    DIST_CONSTANT_SCALE,
    DIST_HZ_CONSTANT,
    DIST_HZ_CONSTANT_SCALE,
    DIST_HZ_SCALE,
    DIST_SCALE,
    ZEN_REFRACTION,
)
from obseq.survey.kinds.components import DX, DX_SCALE, DY, DY_SCALE, DZ, DZ_SCALE
from obseq.survey.kinds.coordinates import BARY_X, BARY_Y, BARY_Z, NORMAL_ROW, POINT_X, POINT_Y, POINT_Z
from obseq.survey.kinds.directions import ALPHA, ANGLE, AZIM, BETA, HZ, ZEN
from obseq.survey.kinds.equalities import EQUAL_DH, EQUAL_DIST
from obseq.survey.kinds.formulas import FormulaKind, kind_of
from obseq.survey.kinds.geodetic import CHORD, GEO_X, GEO_Y, GEO_Z, HEIGHT, LATITUDE, LONGITUDE
from obseq.survey.kinds.kind import FirstPlace, ObservationKind, Start
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ, DIST_HZ0
from obseq.survey.kinds.vectors import LOCAL_X, LOCAL_Y, LOCAL_Z, VECTOR, VECTOR_Y, VECTOR_Z

KINDS: tuple[ObservationKind, ...] = (
    *(DIST, DH, HZ, AZIM, ZEN, DX, DY, DZ),
    *(DIST_HZ0, ALPHA, BETA, VECTOR, VECTOR_Y, VECTOR_Z, EQUAL_DH, EQUAL_DIST),
    *(AXIS_RADIUS, AXIS_PLANE, AXIS_LINK),
    *(DIST_HZ, ANGLE, LOCAL_X, LOCAL_Y, LOCAL_Z, POINT_X, POINT_Y, POINT_Z),
    *(DIST_CONSTANT, DIST_SCALE, DIST_CONSTANT_SCALE, ZEN_REFRACTION),
    *(DIST_HZ_CONSTANT, DIST_HZ_SCALE, DIST_HZ_CONSTANT_SCALE),
    *(DX_SCALE, DY_SCALE, DZ_SCALE),
    *(BARY_X, BARY_Y, BARY_Z, NORMAL_ROW),
    *(GEO_X, GEO_Y, GEO_Z, HEIGHT, LATITUDE, LONGITUDE, CHORD),
)

BY_CODE = {kind.code: kind for kind in KINDS}
BY_NAME = {kind.name: kind for kind in KINDS}
FAMILIES = {kind.group: tuple(other for other in KINDS if other.group == kind.group) for kind in KINDS}
"""The kinds of each family."""
IS_ANGLE: npt.NDArray[np.bool_] = np.zeros(256, np.bool_)
"""Of each code, whether it is an angle."""
IS_ANGLE[[kind.code for kind in KINDS if kind.is_angle]] = True
AXIS_OF_VECTOR: npt.NDArray[np.int8] = np.full(256, -1, np.int8)
"""Of each code, which component of a vector, or of a geocentric position, it is: 0 to 2; -1 for none."""
_TRIPLES = ((VECTOR, VECTOR_Y, VECTOR_Z), (LOCAL_X, LOCAL_Y, LOCAL_Z), (GEO_X, GEO_Y, GEO_Z))
AXIS_OF_VECTOR[[kind.code for triple in _TRIPLES for kind in triple]] = np.tile(np.arange(3), len(_TRIPLES))

WITH_UNKNOWNS = {
    (kind.plain.code, frozenset(kind.with_unknowns)): kind for kind in KINDS if kind.plain is not None
}
"""What observations of a code are where a user asks for some unknowns of theirs."""
UNKNOWNS = tuple(dict.fromkeys(name for kind in KINDS for name in kind.with_unknowns))
"""What can be asked for."""

FIRST_OF_FORMULAS = 200
"""Code of the first kind that is made from a formula; they end with the codes."""


def kind_of_formula(formula: str | Kernel) -> FormulaKind:
    """The kind of observations of a formula, made at the first call; files can name it from then on.

    Args:
        formula: A name of the catalogue or of a formula given before, or a compiled formula of the user's.

    Raises:
        FormulaError: No formula has that name.
        InputError: The formula is not one of one to three points, with one residual.
    """
    known = BY_NAME.get(formula if isinstance(formula, str) else formula.name)
    if isinstance(known, FormulaKind) and isinstance(formula, str):
        return known
    code = known.code if isinstance(known, FormulaKind) else _next_code(formula)
    kind = kind_of(load(formula) if isinstance(formula, str) else formula, code)
    if known is not None and not isinstance(known, FormulaKind):
        raise InputError(f"formula {kind.name}: an observation of another kind is called so; rename it")
    BY_CODE[code] = BY_NAME[kind.name] = kind
    FAMILIES[kind.group] = (kind,)
    IS_ANGLE[code] = kind.is_angle
    codes_for.cache_clear()
    codes_placed_by.cache_clear()
    return kind


def _next_code(formula: str | Kernel) -> int:
    code = max(FIRST_OF_FORMULAS, max(BY_CODE) + 1)
    if code >= len(IS_ANGLE):
        most = len(IS_ANGLE) - FIRST_OF_FORMULAS
        raise InputError(f"formula {formula}: more than {most} formulas are used as observations")
    return code


def codes_where(is_wanted: Callable[[ObservationKind], bool]) -> list[int]:
    """The codes of the kinds that answer yes, those of formulas too."""
    return [code for code, kind in BY_CODE.items() if is_wanted(kind)]


def codes_with(unknown: str) -> dict[int, int]:
    """By code of observations, their code where this is their only unknown."""
    return {code: kind.code for (code, names), kind in WITH_UNKNOWNS.items() if names == {unknown}}


@lru_cache
def codes_for(*uses: Start) -> Sequence[int]:
    """The codes of the kinds that give these things to initial values."""
    return codes_where(lambda kind: kind.start in uses)


@lru_cache
def codes_placed_by(use: FirstPlace) -> Sequence[int]:
    """The codes of the kinds that give a point a first place in this way."""
    return codes_where(lambda kind: kind.first_place is use)


def among(types: npt.NDArray[np.int16], wanted: Sequence[int]) -> npt.NDArray[np.bool_]:
    """(n,) whether codes are among some; for short columns much faster than `np.isin`."""
    return _wanted(tuple(wanted))[types]


@lru_cache
def _wanted(wanted: tuple[int, ...]) -> npt.NDArray[np.bool_]:
    """Of each code, whether it is among some."""
    is_wanted = np.zeros(len(IS_ANGLE), np.bool_)
    is_wanted[list(wanted)] = True
    return is_wanted


def codes(*kinds: ObservationKind) -> list[int]:
    """The codes of some kinds."""
    return [kind.code for kind in kinds]
