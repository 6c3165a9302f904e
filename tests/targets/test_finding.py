"""Targets that are found: all of them, under their names, to hundredths of a pixel, with true sigmas."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from obseq.images import Camera
from obseq.targets import Conditions, Finder, Sheet, eccentricity, made, photograph, read_picture
from obseq.targets.finding.light_spots import above_mean

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "targets"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data/targets is absent")
EDGE = 60
"""Pixels that half a target takes."""
SCENES = {
    "dev_1": (["IGNIndoor"], 480, 200, 640),
    "dev_2": (["CERN", "IGNIndoor"], 1000, 80, 520),
    "dev_3": (["IGNDroneSym"], 80, 40, 800),
}
"""Families, and the square that is looked at: column, row, size; the bench looks at all."""


@needs_data
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_scenes_are_measured_to_hundredths_of_a_pixel(name: str) -> None:
    families, *corner, size = SCENES[name]
    truth = json.loads((DATA / "dev" / f"{name}.json").read_text(encoding="utf-8"))
    grey = read_picture(DATA / "dev" / truth["image"]).grey
    part = grey[corner[1] : corner[1] + size, corner[0] : corner[0] + size]
    found = Finder([made(family, choice="present") for family in families]).find(part)
    known = {
        one["name"]: np.array([one["x"], one["y"]]) - corner
        for one in truth["targets"]
        if one["role"] in ("coded", "occluded")
    }
    coded = {one["name"] for one in truth["targets"] if one["role"] == "coded"}
    whole = {name for name in coded if np.abs(known[name] - size / 2).max() < size / 2 - EDGE}
    places = {target.name: target.centre for target in found.targets}
    assert len(whole) > 4 and whole <= places.keys()
    errors = [places[name] - known[name] for name in places]  # a false name: KeyError
    assert math.sqrt(np.mean(np.sum(np.square(errors), axis=1))) < 0.015
    ratios = [
        error @ np.linalg.solve(target.covariance, error) / 2.0
        for error, target in zip(errors, found.targets, strict=True)
    ]
    assert 0.4 < np.mean(ratios) < 2.5


@needs_data
@pytest.mark.slow
def test_targets_of_a_photograph_have_the_names_that_are_known() -> None:
    grey = read_picture(DATA / "real" / "mmvii_panel_aicon14.jpg").grey
    names = {target.name for target in Finder([made("CERN")]).find(grey).targets}
    assert {"046", "072", "073", "074"} <= names


@needs_data
def test_targets_on_a_car_have_names_that_the_original_does_not_give() -> None:
    """Ten bits, chequers upright. Over 00 and 08, which the original names it drew: too much over 00."""
    spec = made("IGNDroneSym", 10)
    spec = replace(spec, geometry=replace(spec.geometry, angle=0.0))
    grey = read_picture(DATA / "real" / "mmvii_training3_car_result.jpg").grey
    found = {target.name: target.centre for target in Finder([spec]).find(grey).targets}
    assert found.keys() == {"08", "10", "11"}
    assert found["08"] == pytest.approx([732, 433], abs=1.5)  # where the drawn axes cross


def test_a_few_pixels_that_show_something_else_move_nothing(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    """Lines across a target, a twentieth of it: its place is that without them, and they are told."""
    image, (truth,) = scene(camera, [sets["IGNIndoor"]], count=1, sizes=(80.0, 80.0))
    x, y = np.round(truth.centre).astype(int)
    drawn = image.copy()
    drawn[y + 12 : y + 14, x - 30 : x + 30] = 255
    (plain,) = Finder([sets["IGNIndoor"]]).find(image).targets
    (target,) = Finder([sets["IGNIndoor"]]).find(drawn).targets
    assert (target.name, len(plain.fit.forgiven)) == (truth.name, 0)
    off = np.divmod(target.fit.forgiven, image.shape[1])[0]
    assert len(off) > 20
    assert np.isin(off, [y + 12, y + 13]).mean() > 0.8
    assert target.centre == pytest.approx(plain.centre, abs=0.02)


def test_bits_may_be_unreadable_as_long_as_others_tell_targets_apart(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    """Grey bits of a target: its name stays as long as those that are left say it, also with an error."""
    spec = sets["IGNDroneSym"]
    image, (truth,) = scene(camera, [spec], count=1, sizes=(120.0, 120.0), tilts=(0.0, 5.0))
    (plain,) = Finder([spec]).find(image).targets
    half = spec.geometry.radii[3]
    across, up = 2.0 * half / 6, half * (math.sqrt(2.0) - 1.0)
    named = []
    for count in (1, 2, 3):
        hidden, is_readable = image.copy(), np.arange(spec.bits) >= count
        for u in np.linspace(0.0, count * across, 60 * count):
            for v in np.linspace(0.0, up, 60):
                x, y = np.round(plain.fit.placed.pixels(np.array([[u - half, -half - v]]))[0]).astype(int)
                hidden[y, x] = plain.fit.offset + 0.5 * plain.fit.gain
        found = [target.name for target in Finder([spec]).find(hidden).targets]
        is_certain = spec.apart(truth.name, is_readable) >= 2 and spec.chance(is_readable) < 0.1
        assert found == ([truth.name] if is_certain else [])
        named.append(bool(found))
    assert named[0] and not all(named)


@pytest.mark.parametrize("family", ["CERN", "IGNIndoor", "IGNDroneSym", "IGNDroneTop"])
def test_each_family_is_found_and_measured(family, sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    image, truths = scene(camera, [sets[family]])
    found = {target.name: target for target in Finder([sets[family]]).find(image).targets}
    assert found.keys() == {one.name for one in truths}
    for one in truths:
        error = found[one.name].centre - one.centre
        assert error @ np.linalg.solve(found[one.name].covariance, error) < 18.4  # 1 of 10000
        assert math.hypot(*error) < 0.05
        assert found[one.name].size == pytest.approx(one.size, rel=0.1)


@pytest.mark.slow
def test_two_sets_in_one_image_are_told_apart(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    specs = [sets["CERN"], sets["IGNIndoor"]]
    image, truths = scene(camera, specs, count=8, seed=4)
    found = Finder(specs).find(image)
    assert {(target.name, target.family) for target in found.targets} == {
        (one.name, one.family) for one in truths
    }


@pytest.mark.slow
def test_the_centre_is_that_of_the_circle_not_of_its_ellipse() -> None:
    """A disc of 40 pixels at 45 degrees: the ellipse is most of a pixel off, and the closed form says how."""
    spec = made("CERN")
    camera = Camera("c", 640, 640, 900.0, [319.5, 319.5])  # type: ignore[arg-type]
    unit, turn = 40.0 / 900.0, math.sqrt(0.5)
    sheet = Sheet(
        spec, "100", np.array([0.02, 0.01, 1.0]), unit * np.array([turn, 0, turn]), np.array([0, unit, 0])
    )
    image, (truth,) = photograph(camera, [sheet], Conditions(noise=1.0))
    (target,) = Finder([spec], focal=900.0).find(image).targets
    off = eccentricity(camera, sheet.centre, np.cross(sheet.right, sheet.down), unit)
    assert math.hypot(*off) > 0.7
    assert target.centre == pytest.approx(truth.centre, abs=0.02)
    assert target.ellipse - truth.centre == pytest.approx(off, abs=0.03)


@pytest.mark.parametrize("family", ["IGNIndoor", "IGNDroneSym", "IGNDroneTop"])
def test_targets_of_twenty_pixels_are_found(family, sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    """Bits of two pixels, beside what is as black: seen only when all are solved together."""
    image, truths = scene(camera, [sets[family]], count=12, sizes=(20.0, 21.0), tilts=(0.0, 30.0))
    found = {target.name: target for target in Finder([sets[family]]).find(image).targets}
    assert found.keys() == {one.name for one in truths}
    for one in truths:
        assert math.hypot(*(found[one.name].centre - one.centre)) < 0.12
        assert (np.abs(np.abs(found[one.name].margins) - 1.0) < 0.6).all()


def test_sixteen_bits_give_what_eight_give(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    finder = Finder([sets["IGNIndoor"]])
    image, truths = scene(camera, [sets["IGNIndoor"]], deep=True)
    assert image.dtype == np.uint16
    assert [target.name for target in finder.find(image).targets] == sorted(one.name for one in truths)


@pytest.mark.slow
def test_inverted_sheets_are_found(camera, scene) -> None:  # type: ignore[no-untyped-def]
    for family in ("CERN", "IGNIndoor"):
        spec = made(family)
        spec = replace(spec, geometry=replace(spec.geometry, is_white=not spec.geometry.is_white))
        image, truths = scene(camera, [spec], count=4)
        found = Finder([spec]).find(image).targets
        assert [target.name for target in found] == sorted(one.name for one in truths)


@pytest.mark.slow
def test_hidden_targets_get_no_wrong_name(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    for seed in (1, 2):
        image, truths = scene(camera, [sets["IGNIndoor"]], hidden=1.0, seed=seed)
        places = {one.name: one.centre for one in truths}
        found = Finder([sets["IGNIndoor"]]).find(image)
        assert all(math.hypot(*(places[one.name] - one.centre)) < 1.0 for one in found.targets)
        assert found.refused


@pytest.mark.slow
def test_codes_of_other_sets_are_refused_with_the_reason(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    image, _ = scene(camera, [sets["IGNIndoor"]])
    other = made("IGNIndoor", numbers={35})
    found = Finder([other]).find(image)
    assert len(found.targets) <= 1
    assert any(refusal.stage.startswith("code of the set") for refusal in found.refused)


def test_spots_without_code_are_measured_when_asked_for() -> None:
    camera = Camera("c", 300, 200, 900.0, [149.5, 99.5])  # type: ignore[arg-type]
    x, y = np.meshgrid(np.arange(300.0), np.arange(200.0))
    scenery = np.where((abs(x - 150) < 45) & (abs(y - 100) < 45), 40.0, 150.0)
    finer = [(np.arange(4 * size) + 0.5) / 4 - 0.5 for size in (300, 200)]
    fine = np.hypot(*np.meshgrid(finer[0] - 150.3, finer[1] - 99.6))
    share = (fine < 9.0).reshape(200, 4, 300, 4).mean(axis=(1, 3))
    image, _ = photograph(camera, [], Conditions(ramp=0.0), scenery=scenery + share * 150.0)
    found = Finder([made("CERN")], uncoded=True).find(image)
    assert found.targets == []
    (spot,) = found.uncoded
    assert spot.centre == pytest.approx([150.3, 99.6], abs=0.05)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((300, 400), dtype=np.uint8),
        np.full((300, 400), 255, dtype=np.uint8),
        np.full((16, 900), 77, dtype=np.uint8),
        np.random.default_rng(1).integers(0, 256, (300, 400), dtype=np.uint8),
        np.tile(np.kron([[0, 255], [255, 0]], np.ones((12, 12))), (3, 3)).astype(np.uint8),
        np.kron(np.random.default_rng(2).integers(0, 2, (40, 50)) * 255, np.ones((5, 5))).astype(np.uint8),
    ],
    ids=["black", "white", "narrow", "noise", "floor", "blocks"],
)
def test_nothing_is_found_where_nothing_is(image, sets) -> None:  # type: ignore[no-untyped-def]
    specs = [sets["CERN"], sets["IGNIndoor"]]
    assert Finder(specs, uncoded=False).find(image).targets == []


@pytest.mark.parametrize("reach", [1, 3, 20])
def test_what_is_lighter_than_the_mean_about_it(reach):
    image = np.random.default_rng(4).uniform(0.0, 255.0, (11, 14))
    found = np.zeros(image.shape, np.uint8)
    above_mean(image, reach, 10.0, np.zeros(15), found)
    around = [
        [
            image[max(j - reach, 0) : j + reach + 1, max(i - reach, 0) : i + reach + 1].mean()
            for i in range(14)
        ]
        for j in range(11)
    ]
    np.testing.assert_array_equal(found, image > np.array(around) + 10.0)


@pytest.mark.slow
@pytest.mark.parametrize("contrast", [4.0, 12.0])
def test_what_steps_of_a_jpeg_can_be_is_no_target(contrast: float) -> None:
    """Means of squares of a JPEG of quality 50 have steps of 2 grey levels: two of them are no ink."""
    camera = Camera("c", 200, 240, 900.0, [99.5, 119.5])  # type: ignore[arg-type]
    right, down = np.array([0.04, 0.0, 0.0]), np.array([0.0, 0.04, 0.0])
    middle = np.array([0.0, -0.02, 1.0])
    sheet = Sheet(made("IGNDroneTop"), "21", middle, right, down, 110.0 + contrast, 110.0)
    image, _ = photograph(camera, [sheet], Conditions(noise=0.3, ramp=0.0))
    found = Finder([made("IGNDroneTop")]).find(image)
    assert [one.name for one in found.targets] == (["21"] if contrast > 5.0 else [])
    assert any("grey levels of ink" in one.stage for one in found.refused) == (contrast < 5.0)


def test_noise_that_squares_have_in_common_is_in_the_covariance(sets, camera, scene) -> None:  # type: ignore[no-untyped-def]
    """A grey level more or less for each square of 8 pixels: residuals grow little, sigmas much."""
    image, _ = scene(camera, [sets["IGNIndoor"]])
    squares = np.random.default_rng(3).normal(0.0, 4.0, [size // 8 + 1 for size in image.shape])
    common = np.kron(squares, np.ones((8, 8)))[: image.shape[0], : image.shape[1]]
    mixed = np.random.default_rng(4).permutation(common.ravel()).reshape(image.shape)
    sigmas = []
    for noise in (common, mixed):
        found = Finder([sets["IGNIndoor"]]).find(np.clip(np.round(image + noise), 0, 255).astype(np.uint8))
        sigmas.append(np.median([np.trace(one.covariance) / one.fit.sigma0**2 for one in found.targets]))
    assert sigmas[0] > 2.0 * sigmas[1]
