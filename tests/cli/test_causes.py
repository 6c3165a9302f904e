"""`obseq causes`: every code that a result can hold has one page, and only one."""

import re
from collections import Counter
from pathlib import Path

import pytest

import obseq
from obseq.cli.causes import sections
from obseq.cli.main import main
from obseq.images.causes.registry import CAUSES as OF_BLOCKS
from obseq.images.causes.registry import SHARED
from obseq.survey.causes.registry import CAUSES as OF_NETWORKS

CODE = re.compile(r'"([SIW]1\d\d|S2\d\d)"')
WRITERS = ("survey/causes", "images/causes")
PAGES = {"pages.py", "slip_pages.py"}
BY_CODE = {page.code: page for pages in sections().values() for page in pages}


def written() -> set[str]:
    """The codes in the files that write results."""
    root = Path(obseq.__file__).parent
    files = [path for room in WRITERS for path in (root / room).glob("*.py") if path.name not in PAGES]
    found = (CODE.findall(re.sub(r'such as "\w+"', "", path.read_text(encoding="utf-8"))) for path in files)
    return {code for codes in found for code in codes}


def test_every_code_has_one_page() -> None:
    counts = Counter(page.code for pages in sections().values() for page in pages)
    assert set(counts.values()) == {1}
    assert set(counts) == written()


def test_pages_are_whole() -> None:
    for page in BY_CODE.values():
        texts = (page.about, *page.tested, page.example, page.remedy)
        assert page.name and page.tested
        assert all(text[0] in "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789" for text in texts), page
        assert all(text.endswith(".") for text in texts), page


@pytest.mark.parametrize("cause", [*OF_NETWORKS, *OF_BLOCKS, *SHARED], ids=lambda one: one.code)
def test_a_cause_is_listed_and_explained_in_its_own_words(cause, capsys) -> None:
    assert main(["causes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (line,) = (one for one in lines if one.startswith(cause.code))
    assert cause.name in line and cause.about in line
    assert main(["causes", cause.code.lower()]) == 0
    shown = capsys.readouterr().out
    assert all(text in shown for text in (cause.name, cause.about, cause.example, cause.remedy))


def test_a_page_says_what_is_tested(capsys) -> None:
    main(["causes", "S120"])
    shown = capsys.readouterr().out
    assert "Where it may be: a set-up" in shown and "One size for all of them (radians)" in shown
    main(["causes", "S160"])
    assert "only with a slip" in capsys.readouterr().out


def test_an_unknown_code_is_told_the_nearest(capsys) -> None:
    assert main(["causes", "W1200"]) == 2
    assert "there is no cause W1200; did you mean W120?" in capsys.readouterr().err
    assert main(["causes", "nothing"]) == 2
    assert "did you mean" not in capsys.readouterr().err
