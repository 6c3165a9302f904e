import re
from html.parser import HTMLParser

from obseq.report import page

VOID = {"meta", "path", "circle", "ellipse"}


class Checker(HTMLParser):
    """Notes elements that are not closed in order, and everything the page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        self.loaded += [value for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs) -> None:
        assert tag in VOID

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag


def checked(text: str) -> str:
    checker = Checker()
    checker.feed(text)
    checker.close()
    assert checker.open == []
    assert checker.loaded == []
    return text


def test_the_page_is_well_formed_and_self_contained(record) -> None:
    text = checked(page(record))
    assert "$" not in text
    assert "http" not in text


def test_it_shows_the_fit_and_the_worst_residual_first(record) -> None:
    text = page(record)
    assert "1.25 accepted; chi-square test at 95 %: between 0.348 and 1.669 is expected" in text
    assert text.index("-3.100 mgon") < text.index("1.00 mm")


def test_names_are_escaped(plain, make) -> None:
    plain["points"][0]["name"] = "<b>&$x"
    text = checked(page(make()))
    assert "&lt;b&gt;&amp;$x" in text
    assert "<b>" not in text


def test_a_large_network_does_not_make_a_large_page(plain, make) -> None:
    plain["points"] = [plain["points"][0] | {"name": f"P{k}", "x": float(k)} for k in range(3000)]
    text = page(make())
    assert "and 1000 more rows" in text
    assert "P2999" not in re.sub(r"<td.*?</td>", "", text)


def test_an_empty_network_has_a_page(make) -> None:
    checked(page(make(points=[], observations=[], stations=[])))


def test_warnings_are_on_the_page(make) -> None:
    assert "<dt>warning</dt><dd >w &lt; 1</dd>" in page(make(warnings=["w < 1"])).replace(' class=""', " ")
