"""What STAR*NET files are refused for, in words that say how a line was read."""

import pytest

from obseq.errors import InputError
from obseq.survey import Network

SITE = """
.UNITS Meters DMS
.ORDER EN
.3D
C A 0 0 10 ! ! !
C B 100 0 10 ! ! !
C P 60 80 10
"""


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("B A-P 393-41-23 3.0", r"n\.dat:8: the angle 393-41-23 is beyond one turn"),
        ("B A-P 33.689774 3.0", r"the angle 33\.689774: .* \(it is read as packed ddd\.mmss\)"),
        ("L A-P 4.052 0.01", r"--sigmas height-per-km.* \(0\.01 is read as the length of the line\)"),
    ],
)
def test_a_line_that_cannot_be_used_says_how_it_was_read(tmp_path, line, message):
    (tmp_path / "n.dat").write_text(f"{SITE}{line}\n")
    with pytest.raises(InputError, match=message):
        Network.read_project(tmp_path / "n.dat")
