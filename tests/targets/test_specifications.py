"""Specification files and drawings against those of the data."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from obseq.errors import InputError
from obseq.targets import (
    draw,
    encoding_text,
    made,
    pdf_bytes,
    read_specification,
    read_specifications,
    specification_text,
    svg_text,
)
from obseq.targets.drawing.drawings import bit_centres, bits_drawn
from obseq.targets.drawing.sheets import outline

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "targets" / "specs"
FULL = sorted(DATA.glob("*_FullSpecif.xml"))
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
needs_data = pytest.mark.skipif(not FULL, reason="../shared/data/targets is absent")


def from_prefix(prefix: str) -> tuple[str, int]:
    """Family and bits."""
    found = re.match(r"(\w+?)_Nbb(\d+)_", prefix)
    assert found is not None
    return found[1], int(found[2])


@needs_data
@pytest.mark.parametrize("path", FULL, ids=lambda path: path.name.split("_Hamm")[0])
def test_specifications_are_those_of_the_data(path: Path) -> None:
    spec = made(*from_prefix(path.name), choice="present")
    assert read_specification(path) == spec
    ours, theirs = specification_text(spec).splitlines(), path.read_text(encoding="utf-8").splitlines()
    assert len(ours) == len(theirs)
    for mine, other in zip(ours, theirs, strict=True):
        assert NUMBER.sub("", mine) == NUMBER.sub("", other)
        np.testing.assert_allclose(
            [float(number) for number in NUMBER.findall(mine)],
            [float(number) for number in NUMBER.findall(other)],
            atol=1e-8,
        )
    encoding = path.with_name(path.name.replace("FullSpecif", "SpecEncoding"))
    assert encoding_text(spec) == encoding.read_text(encoding="utf-8")


@needs_data
def test_counts_codes_and_places_of_bits_are_the_expected_ones() -> None:
    expected = json.loads((DATA / "expected.json").read_text(encoding="utf-8"))
    assert list(made("IGNIndoor").codes.values()) == expected.pop("IGNIndoor12_old_selection")["codes"]
    for prefix, wanted in expected.items():
        spec = made(*from_prefix(prefix), choice="present")
        items = [list(item) for item in spec.codes.items()]
        assert (spec.prefix, len(items)) == (prefix, wanted["number"])
        assert (items[:3], items[-2:]) == (wanted["first"], wanted["last"])
        np.testing.assert_allclose(bit_centres(spec)[:4], wanted["bit_centres_px"], atol=1e-4)


@needs_data
@pytest.mark.parametrize("prefix", sorted({path.name.split("_Target_")[0] for path in DATA.glob("*.png")}))
def test_drawings_are_those_of_the_data(prefix: str) -> None:
    family, bits = from_prefix(prefix)
    spec = made(family, bits, choice="present")
    for path in DATA.glob(f"{prefix}_Target_*.png"):
        wanted = np.asarray(Image.open(path)).astype(int)
        mine = draw(spec, path.stem.rpartition("_")[2]).astype(int)
        assert mine.shape == wanted.shape
        assert np.abs(mine - wanted).max() <= 1


def test_a_file_that_is_written_is_read(tmp_path: Path) -> None:
    for family in ("IGNIndoor", "IGNDroneSym", "IGNDroneTop", "CERN"):
        spec = made(family)
        for text in (specification_text(spec), encoding_text(spec)):
            (tmp_path / "a.xml").write_text(text, encoding="utf-8")
            assert read_specification(tmp_path / "a.xml") == spec


def test_files_of_2022_are_read(tmp_path: Path) -> None:
    """No Root, no level above, a count in lists, a tag with a comma, and 9 bits for the 12 of the codes."""
    spec = made("IGNIndoor")
    text = specification_text(spec)
    text = re.sub(r"<Root>.*?<Data>\s*<FullSpecifTarget>", "<MMVII_Serialization>", text, flags=re.DOTALL)
    text = re.sub(r"</FullSpecifTarget>\s*</Data>\s*</Root>", "</MMVII_Serialization>", text)
    text = text.replace("GeometryCodedTarget", "Geometry").replace("AntiClockWiseBit>", "AntiClockWiseBit,>")
    text = text.replace("<Encoding>", "<Encoding><Nb>36</Nb>").replace("<Centers>", "<Centers><Nb>12</Nb>")
    text = text.replace('<TargetNamePrefix>""</TargetNamePrefix>', "")
    head, tail = text.split("<Geometry>")
    text = head + "<Geometry>" + tail.replace("<NbBits>12<", "<NbBits>9<")
    (tmp_path / "old.xml").write_text(text, encoding="utf-8")
    assert read_specification(tmp_path / "old.xml") == spec


def test_rows_of_before_august_2023_are_told_by_the_places_of_bits(tmp_path: Path) -> None:
    usual = made("IGNDroneSym")
    old = replace(usual, geometry=replace(usual.geometry, is_lower_row_forwards=True))
    (tmp_path / "old.xml").write_text(specification_text(old), encoding="utf-8")
    assert read_specification(tmp_path / "old.xml") == old
    assert not np.array_equal(draw(usual, "05"), draw(old, "05"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<FreqCircEq>2", "<FreqCircEq>5", "frequency 5"),
        ("<NumCode>1 ", "<NumCode>1 585 ", "2 numbers"),
        ('<Name>"01"', '<Name>"00"', "stands twice"),
        ('<Name>"01"', '<Name>"0 1"', "spaces"),
        (
            "<NbBits>12</NbBits>\n               <F",
            "<NbBits>8</NbBits>\n               <F",
            "more than 8 bits",
        ),
        ("<ThickN_Code>0.35", "<ThickN_Code>-1", "code is -1"),
        ("<ThickN_Code>0.35", "<ThickN_Code>nan", "not a number"),
        ('<Type>"IGNIndoor"</Type>\n               <N', '<Type>"AICON"</Type>\n               <N', "family"),
        ("<Root>", "<Root", "broken"),
        ("<Specifs>", "<Specs>", "broken"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = specification_text(made("IGNIndoor"))
    assert old in text
    path = tmp_path / "bad.xml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=said) as error:
        read_specification(path)
    assert str(error.value).startswith(str(path))


def test_two_sets_with_the_same_names_are_refused(tmp_path: Path) -> None:
    for name, family in (("a.xml", "IGNIndoor"), ("b.xml", "IGNDroneSym")):
        (tmp_path / name).write_text(specification_text(made(family)), encoding="utf-8")
    with pytest.raises(InputError, match=r"b\.xml: the target 00 is also in"):
        read_specifications([tmp_path / "a.xml", tmp_path / "b.xml"])


@pytest.mark.parametrize("family", ["IGNIndoor", "IGNDroneSym", "IGNDroneTop", "CERN"])
def test_outlines_are_the_drawing(family: str) -> None:
    """Polygons filled by another program give the pixels of the drawing, but along edges."""
    spec = made(family)
    name = list(spec.codes)[7]
    wanted = draw(spec, name) > 127
    scale, middle = spec.raster.scale / 3, np.array(spec.raster.middle) / 3
    canvas = Image.new("L", wanted.shape[::-1], 0)
    for polygon in outline(spec, name).ink:
        colour = 255
        ImageDraw.Draw(canvas).polygon([tuple(place) for place in polygon * scale + middle], fill=colour)
    ink = np.asarray(canvas) > 127
    is_white = ~ink if spec.geometry.is_white else ink
    mark = np.zeros_like(ink)
    assert (is_white != wanted)[~mark].mean() < 0.02


@pytest.mark.parametrize("family", ["IGNIndoor", "CERN"])
def test_bits_are_drawn_as_digits_of_the_code_or_of_its_complement(family: str) -> None:
    spec = made(family)
    code = spec.codes[list(spec.codes)[7]]
    bits = bits_drawn(spec, code)
    inked = int(sum(bit * 2**k for k, bit in enumerate(bits)))
    assert len(bits) == spec.bits
    assert inked == (code if spec.geometry.zero_is_sheet else 2**spec.bits - 1 - code)


def test_sheets_have_the_stated_size() -> None:
    spec = made("IGNDroneSym")
    assert 'width="150mm" height="212.132mm"' in svg_text(spec, "07", 150.0)
    pdf = pdf_bytes(spec, ["07", "08"], 150.0)
    width, height = map(float, re.findall(rb"MediaBox\[0 0 ([\d.]+) ([\d.]+)\]", pdf)[0])
    assert width == pytest.approx(150 * 72 / 25.4, abs=1e-3)
    assert height == pytest.approx((150 * 2**0.5 + 4) * 72 / 25.4, abs=1e-3)
    assert pdf.count(b"/Type/Page/") == 2
    begin = int(pdf.rsplit(b"startxref\n", 1)[1].split()[0])
    assert pdf[begin:].startswith(b"xref")
    with pytest.raises(InputError, match="1 to 5000 mm"):
        svg_text(spec, "07", 0.0)
