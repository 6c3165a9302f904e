"""The open adjustment: a survey, images, a clinometer and formulas by name, against a dense reference."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import obseq
from obseq.codegen import compile_formula
from obseq.errors import InputError, ObseqError
from obseq.formulas import Formula
from obseq.formulas import formula as formula_named
from obseq.formulas.blocks import Length, Point3
from obseq.formulas.functions import Scalar
from obseq.images import BundleAdjustment, Camera, Clinometer, ImagePoints
from obseq.survey import Network, make_points, read_obs
from obseq.survey.model import join

RNG = np.random.default_rng(7)
PIXEL, LENGTH, ANGLE, KNOWN, TILT, MEAN = 0.3, 0.001, 1e-4, 0.002, 2e-4, 0.0005
IMAGES = 4
CAMERA = Camera("wide", 4000, 3000, focal=2500.0)
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""A camera that looks along y, its lines going down."""


class MeanHeight(Formula):
    """Mean height of two points, as a tube between them shows it."""

    def residual(self, first: Point3, second: Point3, *, height: Length) -> Scalar:
        """The mean minus what was read."""
        return (first.z + second.z) / 2 - height


@dataclass
class Truth:
    """A site: three pillars, eight targets, some images."""

    points: dict[str, np.ndarray] = field(default_factory=dict)
    rotations: dict[str, np.ndarray] = field(default_factory=dict)
    axis: np.ndarray = field(default_factory=lambda: np.array([0.05, -0.02, 1.0]))


@pytest.fixture(scope="module")
def truth() -> Truth:
    found = Truth()
    for name, place in {"S1": [0, 0, 1.5], "S2": [6, 1, 1.4], "S3": [3, 14, 1.6]}.items():
        found.points[name] = np.array(place, float)
    for k in range(8):
        found.points[f"T{k}"] = np.array([RNG.uniform(-2, 8), RNG.uniform(8, 12), RNG.uniform(0, 4)])
    for k, x in enumerate(np.linspace(0.5, 5.5, IMAGES)):
        found.points[f"im{k}"] = np.array([x, -1.0, 1.7 + 0.1 * k])
        turn = Rotation.from_rotvec([0.03 * (-1) ** k, 0.1 * (k % 3 - 1), 0.08 * (x - 3.0)]).as_matrix()
        found.rotations[f"im{k}"] = turn @ UPRIGHT
    return found


@dataclass
class Site:
    """The same observations twice: in an open adjustment, and as rows of formulas for the reference."""

    adjustment: obseq.Adjustment
    rows: list[tuple[Formula, list[str], list[float], float]]
    known: dict[str, np.ndarray]


@pytest.fixture(scope="module")
def site(truth: Truth, tmp_path_factory) -> Site:
    rows: list[tuple[Formula, list[str], list[float], float]] = []
    at = truth.points
    targets = [name for name in at if name.startswith("T")]
    images = list(truth.rotations)

    # images, with the readings of a clinometer
    block = BundleAdjustment()
    block.add_cameras(CAMERA)
    near = {name: at[name] + RNG.normal(0, 0.01, 3) for name in images}
    turned = [
        truth.rotations[name] @ Rotation.from_rotvec(RNG.normal(0, 2e-3, 3)).as_matrix() for name in images
    ]
    block.add_poses(images, [near[name] for name in images], turned)
    block.freeze_parameters(".*")
    seen = []
    for name in images:
        local = (np.array([at[t] for t in targets]) - at[name]) @ truth.rotations[name]
        pixels = CAMERA.project(local) + RNG.normal(0, PIXEL, (len(targets), 2))
        seen += [(name, t, xy) for t, xy in zip(targets, pixels, strict=True)]
    names, points, xy = zip(*seen, strict=True)
    block.add_measures(ImagePoints.of(names, points, np.array(xy), PIXEL))
    colinearity = formula_named(CAMERA.formula)
    rows += [(colinearity, [t, name, "wide"], list(pixel), PIXEL) for name, t, pixel in seen]
    block.add_clinometer(Clinometer("tilt", np.array([0.0, 0.0, 1.0])))
    clino = formula_named("Clino_0_3")
    axis = truth.axis / np.linalg.norm(truth.axis)
    readings = [float(np.arcsin((truth.rotations[name] @ axis)[2]) + RNG.normal(0, TILT)) for name in images]
    block.add_inclinations("tilt", images, readings, np.full(IMAGES, TILT))
    rows += [
        (clino, [name, "tilt"], [read], TILT * np.cos(read))
        for name, read in zip(images, readings, strict=True)
    ]

    # a survey: distances, one of them from a pillar to a camera
    lines = []
    pairs = [(s, t) for s in ("S1", "S2", "S3") for t in targets[:5]] + [("S1", "im0"), ("S2", "im2")]
    for s, t in pairs:
        length = float(np.linalg.norm(at[t] - at[s]) + RNG.normal(0, LENGTH))
        lines.append(f"3 {s} {t} {length:.7f} {LENGTH}")
        rows.append((formula_named("TopoDist"), [s, t], [float(f"{length:.7f}")], LENGTH))
    path = tmp_path_factory.mktemp("site") / "site.obs"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    known = {name: at[name] + RNG.normal(0, KNOWN, 3) for name in ("S1", "S2", "S3")}
    pillars = make_points(list(known), np.array(list(known.values())), np.full((3, 3), KNOWN))
    book = read_obs([path])
    from obseq import crs
    from obseq.survey.equations.frame import Frame

    system = crs.parse("Local")
    completed, numbered = join(pillars, book)
    adjustment = obseq.Adjustment()
    adjustment.add_images(block)
    adjustment.add_survey(Network(completed, numbered, Frame(system), system))

    # a station that is a camera (#CAM), a distance to a camera by name, a formula of one's own
    for name, t in (("im0", "S2"), ("im1", "S3")):
        x, y, _ = truth.rotations[name].T @ (at[t] - at[name])
        hz = float(np.arctan2(x, y) + RNG.normal(0, ANGLE))
        adjustment.add("TopoHz", station=name, target=t, hz=hz, sigma=ANGLE)
        rows.append((formula_named("TopoHz"), [name, t], [hz], ANGLE))
    length = float(np.linalg.norm(at["im1"] - at["S1"]) + RNG.normal(0, 1e-4))
    adjustment.add("Dist3D", p1="S1", p2="im1", sigma=1e-4, distance=length)
    rows.append((formula_named("Dist3D"), ["S1", "im1"], [length], 1e-4))
    own = MeanHeight()
    height = float((at["T0"][2] + at["T6"][2]) / 2 + RNG.normal(0, MEAN))
    adjustment.add(compile_formula(own), first="T0", second="T6", height=height, sigma=MEAN)
    rows.append((own, ["T0", "T6"], [height], MEAN))
    return Site(adjustment, rows, known)


class Reference:
    """Dense Gauss-Newton by scipy, on the formulas read in floats, rotations as vectors from the truth."""

    def __init__(self, truth: Truth, site: Site) -> None:
        self.site, self.truth = site, truth
        self.names = list(truth.points)
        self.images = list(truth.rotations)
        axis = truth.axis / np.linalg.norm(truth.axis)
        self.frame = np.linalg.svd(axis[None])[2]

    def start(self) -> np.ndarray:
        places = np.concatenate([self.truth.points[name] for name in self.names])
        return np.concatenate([places, np.zeros(3 * len(self.images) + 2)])

    def residuals(self, x: np.ndarray) -> np.ndarray:
        n = len(self.names)
        point = dict(zip(self.names, x[: 3 * n].reshape(n, 3), strict=True))
        turns = x[3 * n : -2].reshape(-1, 3)
        turn = {
            image: self.truth.rotations[image] @ Rotation.from_rotvec(w).as_matrix()
            for image, w in zip(self.images, turns, strict=True)
        }
        sign = np.sign(self.frame[0] @ self.truth.axis)
        axis = sign * self.frame[0] + x[-2] * self.frame[1] + x[-1] * self.frame[2]
        axis /= np.linalg.norm(axis)
        found = [((point[name] - given) / KNOWN).tolist() for name, given in self.site.known.items()]
        for formula, parts, measured, sigma in self.site.rows:
            values = self._evaluated(formula, parts, measured, point, turn, axis)
            found.append([value / sigma for value in values])
        return np.array([value for part in found for value in part])

    def _evaluated(self, formula, parts, measured, point, turn, axis) -> list[float]:
        unknowns: list[float] = []
        context: dict[str, float] = {}
        pending = list(parts)
        for name, atom in formula.atoms:
            is_pair = name.endswith(".centre")
            who = pending[0] if is_pair else pending.pop(0) if pending else ""
            if name == "vertical" or (atom.kind == "Direction" and name != "axis"):
                self._direction(context, atom, np.array([0.0, 0.0, 1.0]))
                unknowns += [0.0, 0.0]
            elif atom.kind == "Direction":
                self._direction(context, atom, axis)
                unknowns += [0.0, 0.0]
            elif atom.kind == "Point3":
                unknowns += point[who].tolist()
            elif atom.kind == "Rotation":
                matrix = turn[who].T if atom.transposed else turn[who]
                context |= dict(zip(atom.context, matrix.ravel(), strict=True))
                unknowns += [0.0, 0.0, 0.0]
            elif name == "correction":
                unknowns += [0.0, 1.0, 0.0, 0.0]
            else:
                unknowns += CAMERA.parameters.tolist()
        values = dict(zip(formula.measured, measured, strict=True)) | context
        return list(formula.evaluate(unknowns, [float(values[name]) for name in formula.observations]))

    @staticmethod
    def _direction(context: dict[str, float], atom, vector: np.ndarray) -> None:
        u, v = np.linalg.svd(vector[None])[2][1:]
        context |= dict(zip(atom.context, np.concatenate([vector, u, v]), strict=True))

    def solution(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], float]:
        found = least_squares(self.residuals, self.start(), method="lm", xtol=1e-12, ftol=1e-14, gtol=1e-14)
        redundancy = len(found.fun) - len(found.x)
        variance = float(found.fun @ found.fun) / redundancy
        cofactors = np.linalg.inv(found.jac.T @ found.jac) * variance
        places, covariances = {}, {}
        for k, name in enumerate(self.names):
            rows = slice(3 * k, 3 * k + 3)
            places[name], covariances[name] = found.x[rows], cofactors[rows, rows]
        return places, covariances, variance**0.5


@pytest.fixture(scope="module")
def solution(site: Site):
    return site.adjustment.solve()


@pytest.mark.slow  # the reference differentiates in Python
def test_it_is_the_dense_solution(truth: Truth, site: Site, solution) -> None:
    places, covariances, sigma0 = Reference(truth, site).solution()
    assert solution.sigma0 == pytest.approx(sigma0, rel=1e-6)
    for name, place in places.items():
        np.testing.assert_allclose(solution.points([name])[0], place, atol=1e-7)
        np.testing.assert_allclose(
            solution.covariance([name])[0], covariances[name], atol=1e-4 * np.abs(covariances[name]).max()
        )


def test_what_was_found_is_near_the_truth(truth: Truth, solution) -> None:
    assert 0.8 < solution.sigma0 < 1.2 and solution.result.converged
    for name, place in truth.points.items():
        off = solution.points([name])[0] - place
        assert off @ np.linalg.inv(solution.covariance([name])[0]) @ off < 20.0, name


def test_its_parts_are_views(site: Site, solution) -> None:
    centres = solution.images.poses.centres
    np.testing.assert_array_equal(centres, solution.points([f"im{k}" for k in range(IMAGES)]))
    (survey,) = solution.surveys
    assert np.abs(survey.residuals(solution.result)).max() < 5 * LENGTH
    assert solution.residuals(0).shape == (1, 1)
    report = solution.report()
    assert "MeanHeight" in report and "The network is sound" in report


def test_a_wrong_observation_of_any_formula_is_named(site: Site, solution) -> None:
    import copy

    assert solution.diagnosis.is_quiet and "off by" not in solution.report().lower()
    wrong = copy.copy(site.adjustment)
    wrong._equations = list(site.adjustment._equations)
    true = float(np.linalg.norm(np.subtract(*solution.points(["S2", "T3"]))))
    wrong.add("Dist3D", p1="S2", p2="T3", sigma=1e-3, distance=true + 0.05)
    found = wrong.solve()
    label, w = found.suspected()[0]
    assert label == "Dist3D S2 T3" and abs(w) > 30.0
    (accused,) = found.diagnosis.accused
    assert accused.what == "Dist3D S2 T3"
    assert accused.size[0] == pytest.approx(0.05, abs=5e-3)
    assert accused.code == "I180" and "Dist3D S2 -> T3 (off by" in found.report()


def test_wrong_observations_without_images_are_named_with_their_sizes() -> None:
    """A scalar, a vector of two and a known value; two errors at once."""
    rng, site = np.random.default_rng(3), obseq.Adjustment()
    at = dict(zip("ABCDEFGH", rng.uniform(0.0, 100.0, (8, 3)), strict=True))
    site.add_points(list("ABC"), [at[name] for name in "ABC"], 0.001)
    site.add_points(list("DEFGH"), [at[name] + rng.normal(0.0, 0.1, 3) for name in "DEFGH"])
    pairs = [(p, q) for p in at for q in at if p < q]
    lengths = [float(np.linalg.norm(at[p] - at[q]) + rng.normal(0.0, 0.001)) for p, q in pairs]
    lengths[pairs.index(("D", "G"))] += 0.1
    lengths[pairs.index(("B", "F"))] -= 0.03
    ends = [list(end) for end in zip(*pairs, strict=True)]
    site.add("Dist3D", p1=ends[0], p2=ends[1], distance=lengths, sigma=0.001)
    found = site.solve()
    sizes = {one.what: one.size[0] for one in found.diagnosis.accused}
    assert sizes == {
        "Dist3D D G": pytest.approx(0.1, abs=0.005),
        "Dist3D B F": pytest.approx(-0.03, abs=0.005),
    }
    assert found.diagnosis.status == "explained"


def test_a_network_and_a_block_are_opened(site: Site, solution) -> None:
    """What they hold is in it, and they stay as they are: together as the block with the survey in it."""
    import copy

    block, (network,) = site.adjustment._block, site.adjustment._networks
    opened = obseq.Adjustment.of(network, block)
    found = opened.solve()
    joined = copy.copy(block)
    joined.surveys = []
    joined.add_survey(network)
    assert found.sigma0 == pytest.approx(joined.solve().sigma0, rel=1e-9)
    opened.add(
        "Dist3D",
        p1="S1",
        p2="im1",
        distance=float(np.linalg.norm(np.subtract(*found.points(["S1", "im1"])))),
        sigma=1e-4,
    )
    assert opened.solve().result.redundancy == found.result.redundancy + 1
    view = found.network()
    np.testing.assert_array_equal(view.points.coordinates, found.points(view.points.names))
    assert np.abs(view.points.coordinates[:3] - network.points.coordinates[:3]).max() > 0.0
    with pytest.raises(InputError, match="survey 1: 1 are in this adjustment"):
        found.network(1)


@pytest.mark.parametrize(
    ("formula", "named", "said"),
    [
        ("Dist3D", {"p1": "A"}, "Dist3D: p2 is missing"),
        ("TopoDist", {"origin": "A", "target": "B"}, "TopoDist: distance is missing"),
        ("TopoDist", {"origin": "A", "target": "B", "distance": "x"}, "distance takes numbers"),
        (
            "TopoDist",
            {"origin": "A", "target": "B", "distanc": 1.0, "distance": 1.0},
            "no argument 'distanc'",
        ),
        ("TopoDist", {"origin": ["A", "B"], "target": ["A", "B", "C"], "distance": 1.0}, "have 1, 2, 3 rows"),
        (
            "TopoDist",
            {"origin": 3, "target": "B", "distance": 1.0},
            "origin is a name, or a list of names, not 3",
        ),
    ],
)
def test_what_does_not_fit_a_formula_is_told(formula, named, said) -> None:
    with pytest.raises(InputError, match=said):
        obseq.Adjustment().add(formula, sigma=1.0, **named)


def _triangle() -> obseq.Adjustment:
    site = obseq.Adjustment()
    site.add_points(["A", "B", "C", "D"], [[0, 0, 0], [9, 0, 0], [0, 9, 0], [1, 2, 7]], 0.0)
    return site


def test_points_are_placed_by_their_equations() -> None:
    site = _triangle()
    site.add_points(["P", "Q"])
    at = {"A": [0, 0, 0], "B": [9, 0, 0], "C": [0, 9, 0], "D": [1, 2, 7], "P": [3, 4, 5], "Q": [4, 1, 3]}
    for name, others in (("Q", "PABD"), ("P", "ABCD")):
        lengths = [float(np.linalg.norm(np.subtract(at[name], at[other]))) for other in others]
        site.add("Dist3D", p1=name, p2=list(others), sigma=0.001, distance=lengths)
    found = site.solve()
    np.testing.assert_allclose(found.points(["P", "Q"]), [at["P"], at["Q"]], atol=1e-8)


def test_two_places_that_fit_alike_are_told() -> None:
    site = _triangle()
    site.add_points(["P"])
    site.add("Dist3D", p1="P", p2=["A", "B", "C"], sigma=0.001, distance=[3.0, 54**0.5, 54**0.5])
    with pytest.raises(InputError, match=r"point P: its equations fit at \(.*\) or \(.*\); give approximate"):
        site.solve()


def test_a_point_that_nothing_places_is_told() -> None:
    site = _triangle()
    site.add_points(["P"])
    site.add("Dist3D", p1="P", p2=["A", "B"], sigma=0.001, distance=[3.0, 4.0])
    with pytest.raises(InputError, match="point P: nothing gives it a place"):
        site.solve()


def test_a_name_of_nothing_is_told_with_the_nearest() -> None:
    site = _triangle()
    site.add("TopoDist", origin="A", target="BB", distance=9.0, sigma=0.01)
    with pytest.raises(InputError, match="TopoDist, target: no Point3 is called 'BB'"):
        site.solve()


def test_unknowns_of_ones_own_are_estimated() -> None:
    """A scale of distances: 1 + 100 ppm."""
    from obseq.kernels import load

    names = [block.name for block in load("Dist3DParam").blocks]
    assert names[:2] == ["p1", "p2"] or len(names) == 3
    site = _triangle()
    unknown = next(name for name in names if not name.startswith("p"))
    site.add_unknowns("length", [9.5])
    site.add("Dist3DParam", p1=["A", "A"], p2=["B", "C"], sigma=0.001, **{unknown: "length"})
    found = site.solve()
    assert found.values(["length"], "Scalar")[0, 0] == pytest.approx(9.0)
    with pytest.raises(ObseqError):
        found.images  # noqa: B018
