"""Cases of `verdict-cases` whose mistakes are named: by the command, as its README says they must be."""

import json

import pytest

from obseq.cli.main import main

SITE = ["adjust", "--cor", "site.cor", "--points-crs", "EPSG:2154", "--obs"]
FRAME = "RTL*6.738977393981088*17.754862500069663*0*EPSG:4326"
BLOCK = ["bundle", "--cameras", "cameras.csv", "--images", "images.csv", "--control", "control.csv"]
WIDE = [*BLOCK, "--image-sigma", "0.3", "--freeze", "K2|K3|p.|b.", "--measures"]
SURVEYS = {
    "06-two-blunders-exit0": (
        ["adjust", "--obs", "a.obs", "--cor", "a.cor", "--frame", FRAME, "--refraction", "0"],
        ({16, 19}, {12, 16, 19}),  # lines 12 and 16 cannot be told apart
    ),
    "zenith-in-degrees one-S5-P08": ([*SITE, "one-S5-P08.obs"], ({147}, {147})),
    "zenith-in-degrees one-S7-P13": ([*SITE, "one-S7-P13.obs"], ({213}, {213})),
    "zenith-in-degrees clean": ([*SITE, "clean.obs"], (set(), set())),
    "scale-of-one-file": (
        ["adjust", "--obs", "day1.obs", "day2.obs", "--cor", "p.cor"],
        (set(range(1, 15)), set(range(1, 15))),
    ),
    "image-600px A-T6": ([*WIDE, "bad-A-T6.csv"], ({8}, {8})),
    "image-600px D-T14": ([*WIDE, "bad-D-T14.csv"], ({76}, {76})),
    "block-crash-two-image-points": (
        [*BLOCK, "--image-sigma", "0.4", "--measures", "measures.csv"],
        ({5}, {5, 6}),
    ),
    "block-one-wrong-point-named-as-two": (
        [*BLOCK, "--image-sigma", "0.4", "--measures", "measures.csv"],
        ({171}, {171}),
    ),
}


@pytest.fixture
def diagnosed(shared_data, tmp_path, monkeypatch, capsys):  # type: ignore[no-untyped-def]
    """Runs a command in the folder of a case; what is accused."""

    def run(case: str, words: list[str]) -> list[dict]:
        monkeypatch.chdir(shared_data / "verdict-cases" / case.split()[0])
        code = main([*words, "--json", str(tmp_path / "result.json")])
        capsys.readouterr()
        accused = json.loads((tmp_path / "result.json").read_text("utf-8"))["diagnosis"]["accused"]
        assert code == int(bool(accused))
        return accused

    return run


@pytest.mark.parametrize("case", SURVEYS)
def test_the_wrong_lines_are_named_and_no_others(diagnosed, case) -> None:  # type: ignore[no-untyped-def]
    words, (least, most) = SURVEYS[case]
    accused = diagnosed(case, words)
    lines = {line["line"] for item in accused for line in item["observations"]}
    assert least <= lines <= most
    if case.startswith("zenith"):
        assert all("degrees read as gon" in item["text"] for item in accused)


@pytest.mark.parametrize(
    ("case", "code", "images"),
    [
        pytest.param("block-exchanged-names-one-named", "I140", ["I4", "I5"], marks=pytest.mark.slow),
        ("block-unit-kilometres-quiet", "I150", []),
    ],
)
def test_exchanged_images_and_another_unit_are_told(diagnosed, case, code, images) -> None:  # type: ignore[no-untyped-def]
    (item,) = diagnosed(case, [*BLOCK, "--image-sigma", "0.4", "--measures", "measures.csv"])
    assert (item["code"], item["images"]) == (code, images)
