"""How point files in free formats are read (`obseq.survey.read_points`)."""

from obseq.dataclass import dataclass


@dataclass(frozen=True)
class PointFileOptions:
    r"""How such files are read, with the names that `ImportGCP` gives them.

    Attributes:
        sigma: Sigma (m) of the coordinates of points that are not free, in the target system; negative: all
            are free; None: the sigmas of the file, or 1 when the format has none (MMVII's default).
        multiplier: MulCoord, a factor of all coordinates.
        name_digits: NbDigName, names that are integers get at least so many digits.
        name_pattern: PatName, (pattern, substitution): a name becomes its matching parts, substituted; a
            point whose name becomes empty is dropped. `$1` and `\1` both mean the first group.
        free_pattern: AddInfoFree, points whose field A matches as a whole are free.
        first_line: NumL0, lines before it are not read (from 0, all lines count).
        last_line: NumLast, this line and those after it are not read; None or negative: to the end.
        comment: Comment, the character that ends a line wherever it stands; empty: none.
        separator: Sep, a character that separates fields as blanks and commas do; empty: none.
        skip_repeated: NoDupL, lines that repeat an earlier line are skipped.
        encoding: of the names.
    """

    sigma: float | None = None
    multiplier: float = 1.0
    name_digits: int | None = None
    name_pattern: tuple[str, str] | None = None
    free_pattern: str | None = None
    first_line: int = 0
    last_line: int | None = None
    comment: str = "#"
    separator: str = ""
    skip_repeated: bool = False
    encoding: str = "utf-8"
