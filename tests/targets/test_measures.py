"""Tables of measures: what is written is read again, and what is wrong is named."""

from pathlib import Path

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.targets import read_table
from obseq.targets.measures import Measure, block_text, measures_text

HEAD = "image,point,x,y,sxx,sxy,syy\n"


def test_names_come_back_and_are_no_formulas(tmp_path: Path) -> None:
    covariance = np.array([[2.5e-3, 1e-4], [1e-4, 3e-3]])
    given = [Measure('a,"b".tif', "=1+1", np.array([-1.25, 7.5]), covariance)]
    (tmp_path / "m.csv").write_text(measures_text(given), encoding="utf-8")
    (found,) = read_table(tmp_path / "m.csv")
    assert (found.image, found.point) == ('a,"b".tif', "=1+1")
    assert found.xy == pytest.approx([-1.25, 7.5])
    assert found.covariance == pytest.approx(covariance)
    for text in (measures_text(given), block_text(given)):
        assert text.splitlines()[1].startswith('"a,""b"".tif",\'=1+1,-1.2500,7.5000,')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEAD + "i,A,1,2,1,0,1\ni,B,1,2,1,2,1\n", r"m.csv:3: point B: sxx, sxy and syy are no variances"),
        (HEAD + "i,A,1,2,0,0,1\n", r"m.csv:2: point A: sxx, sxy and syy are no variances"),
        (HEAD + "i,A,1,inf,1,0,1\n", r"m.csv:2: y is 'inf', which is no finite number"),
        (HEAD + "i,A,1,2\n", r"m.csv:2: 4 cells for 7 columns"),
        ("image,point,x,y\n", r"m.csv: column 'sxx' is missing"),
    ],
)
def test_a_table_that_is_none_says_where(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "m.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_table(tmp_path / "m.csv")
