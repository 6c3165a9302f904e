"""Random blocks of images, from a seed: a scene, cameras around it, and what else was observed."""

import numpy as np
from referee.blocks import Block, Clinometer, Image, projected
from referee.earth import Frame, System, tangent
from referee.equations import Equations
from referee.network import Observation, Point, Setup, Unknowns, rotation


def looking_at(centre, target, roll):
    """(3, 3) camera to world: z towards a target, lines going down, then rolled about z."""
    z = (target - centre) / np.linalg.norm(target - centre)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1) @ rotation(np.array([0.0, 0.0, roll]))


class BlockMaker:
    """Makes one block."""

    def __init__(self, seed):
        self.random = r = np.random.default_rng([seed, 37])
        self.size = float(10 ** r.uniform(0, 3))
        self.has_survey = r.random() < 0.5
        self.frame = Frame("Local", "plane")
        if self.has_survey and r.random() < 0.7:
            latitude = float(
                r.choice([-1, 1]) * (r.uniform(88, 89.99) if r.random() < 0.33 else r.uniform(0, 80))
            )
            self.frame = tangent(float(r.uniform(-180, 180)), latitude, 100.0)
        self.is_free = not self.has_survey and r.random() < 0.2
        self.points = {
            f"P{k}": self.size * r.uniform(-0.5, 0.5, 3) * (1, 1, 0.4) for k in range(int(r.integers(12, 25)))
        }
        self.n_known = 0 if self.is_free else int(r.integers(3, 8))
        self.spread = self.size * 10 ** r.uniform(-5, -3.3)
        self.true = {}

    def cameras(self):
        """One or two calibrations, and what of them keeps its value."""
        r = self.random
        found = {}
        for name in ("wide", "long")[: int(r.integers(1, 3))]:
            f = float(r.uniform(2500, 4500))
            small = [r.normal(0, s) for s in (10, 10, 0.05, 0.03, 0.01, 1e-3, 1e-3, 1e-4, 1e-4)]
            found[name] = np.array([f, 2000 + small[0], 1500 + small[1], *small[2:]])
        frozen = [
            (),
            ("K3", "b1", "b2"),
            ("K2", "K3", "p1", "p2", "b1", "b2"),
            tuple("F PPx PPy K1 K2 K3 p1 p2 b1 b2".split()),
        ]
        return found, frozen[int(r.integers(0, 4))]

    def image(self, name, camera, angle):
        """An image from a ring around the scene."""
        r = self.random
        centre = self.size * np.array([1.4 * np.cos(angle), 1.4 * np.sin(angle), r.uniform(0.2, 0.9)])
        return Image(
            name,
            camera,
            centre,
            looking_at(
                centre,
                self.size * r.uniform(-0.05, 0.05, 3),
                r.uniform(-0.3, 0.3) + r.choice([0, 0, np.pi / 2]),
            ),
        )

    def rig(self, images, cameras):
        """A second camera beside the first one of all images: exposures are pairs."""
        r = self.random
        place = self.size * np.array([0.05, 0.01, 0.0]), rotation(r.uniform(-0.05, 0.05, 3))
        sigmas = self.size * 1e-5, 1e-5
        more, pairs = [], []
        for k, image in enumerate(images):
            turn = image.turn @ place[1] @ rotation(r.normal(0, sigmas[1], 3))
            centre = image.centre + image.turn @ (place[0] + r.normal(0, sigmas[0], 3))
            more.append(Image(f"B_{k}", list(cameras)[-1], centre, turn))
            pairs.append(("B", image.name, f"B_{k}"))
        return [*images, *more], {"B": place}, sigmas, tuple(pairs)

    def measured(self, images, cameras):
        """By image the points that are seen there, with noise."""
        r, found = self.random, {}
        sigma = float(r.uniform(0.2, 0.8))
        for image in images:
            names = list(self.points)
            local = (np.array(list(self.points.values())) - image.centre) @ image.turn
            columns, lines = projected(local, cameras[image.camera])
            seen = (local[:, 2] > 0) & (columns > 0) & (columns < 4000) & (lines > 0) & (lines < 3000)
            rows = np.flatnonzero(seen)
            pixels = np.column_stack([columns, lines])[rows]
            sigmas = np.where(r.random(len(rows)) < 0.8, sigma, 2 * sigma)
            pixels = np.clip(pixels + r.normal(size=pixels.shape) * sigmas[:, None], 0.01, (3999.9, 2999.9))
            found[image.name] = [names[k] for k in rows], pixels, sigmas
        return found

    def survey(self, points):
        """A total station, distances and heights in the block."""
        r, names = self.random, list(self.points)
        length, angle = self.size * 10 ** r.uniform(-6, -4), 10 ** r.uniform(-6, -4)
        setups, observations = [], []
        for k in range(int(r.integers(1, 3))):
            name = f"S{k}"
            xyz = self.size * np.array([*r.uniform(-1, 1, 2), 0.0])
            known = np.full(3, self.spread if r.random() < 0.5 else np.nan)
            points.append(Point(name, xyz, xyz, known))
            setups.append(Setup(name, str(r.choice(["VERT", "VERT", "FIX", "BASC"]))))
            heights = {} if r.random() < 0.5 else {"hi": 1.5, "ht": 0.1}
            for target in r.permutation(names)[: int(r.integers(3, 8))].tolist():
                for kind, sigma in (("Hz", angle), ("Zen", angle), ("Dist", length)):
                    setup = -1 if kind == "Dist" else k
                    observations.append(
                        Observation(kind, name, target, 0.0, float(sigma), setup=setup, **heights)
                    )
        for kind in ("DH", "Dist", "DH"):
            a, b = r.permutation(names)[:2].tolist()
            observations.append(Observation(kind, a, b, 0.0, float(length)))
        return setups, observations

    def made(self):
        """The block, with values and starts."""
        r, images = self.random, []
        cameras, frozen = self.cameras()
        for k in range(int(r.integers(4, 9))):
            images.append(self.image(f"A_{k}", "wide", 0.8 * k + r.uniform(-0.2, 0.2)))
        places, rig_sigmas, pairs = {}, (), ()
        if r.random() < 0.3 and not self.is_free:
            images, places, rig_sigmas, pairs = self.rig(images, cameras)
        elif len(cameras) > 1:
            for image in images[::2]:
                image.camera = "long"
        used = {image.camera for image in images}
        cameras = {name: values for name, values in cameras.items() if name in used}
        measures = self.measured(images, cameras)
        seen = [name for names, _, _ in measures.values() for name in names]
        self.points = {name: xyz for name, xyz in self.points.items() if seen.count(name) > 1}
        for image, (names, pixels, sigmas) in measures.items():
            kept = [k for k, name in enumerate(names) if name in self.points]
            measures[image] = [names[k] for k in kept], pixels[kept], sigmas[kept]
        points = self.known_points()
        setups, observations = self.survey(points) if self.has_survey else ([], [])
        block = Block(
            self.frame,
            System(self.frame.definition, self.frame),
            points,
            observations,
            setups,
            images=images,
            cameras=cameras,
            frozen=frozen,
            measures=measures,
            places=places,
            rig_sigmas=rig_sigmas,
            pairs=pairs,
        )
        self.observe(block)
        self.more(block)
        self.start(block)
        if self.is_free:
            block.inner, block.datum = (), str(r.choice(["centres", "points"]))
        return block

    def known_points(self):
        r, points = self.random, []
        for k, (name, xyz) in enumerate(self.points.items()):
            sigmas = np.full(3, np.nan)
            if k < self.n_known:
                sigmas = (
                    self.spread * r.uniform(0.5, 2, 3)
                    if k < 3 or r.random() < 0.7
                    else np.array([0.0, 0.0, np.nan])
                )
            points.append(Point(name, xyz, xyz + r.normal(size=3) * np.nan_to_num(sigmas), sigmas))
        return points

    def observe(self, block):
        """Values of the survey: true ones, and errors."""
        r = self.random
        unknowns = Unknowns(block, is_true=True)
        for number, setup in enumerate(block.setups):
            if setup.orientation == "BASC":
                unknowns.bases[number] = rotation(r.uniform(-1, 1, 3))
            elif setup.orientation == "VERT":
                unknowns.values[unknowns.at["turn", number]] = r.uniform(-3, 3)
        at = Equations(block, unknowns, unknowns.values[None].astype(complex))
        for o in block.observations:
            value = float(np.real(at.residual(o)[0])) + r.normal(0, o.sigma)
            o.value = value % (2 * np.pi) if o.kind == "Hz" else value

    def more(self, block):
        """Lengths, positions, clinometers, what is known of the cameras."""
        r, names = self.random, list(self.points)
        if r.random() < 0.3:
            sigma = 1e-4 * self.size
            chosen = [r.permutation(names)[:2].tolist() for _ in range(2)]
            chosen = [pair for k, pair in enumerate(chosen) if set(pair) not in map(set, chosen[:k])]
            block.lengths = tuple(
                (a, b, float(np.linalg.norm(self.points[a] - self.points[b]) + r.normal(0, sigma)), sigma)
                for a, b in chosen
            )
        if r.random() < 0.2 and not self.is_free:
            sigmas = 1e-3 * self.size * r.uniform(0.5, 2, 3)
            block.positions = tuple(
                (image.name, image.centre + r.normal(size=3) * sigmas, sigmas) for image in block.images[:3]
            )
        if r.random() < 0.4:
            self.clinometers(block)
        if r.random() < 0.3 and "F" not in block.frozen:
            block.priors = tuple(
                (name, "F", float(values[0] + r.normal(0, 5)), 5.0) for name, values in block.cameras.items()
            )

    def clinometers(self, block):
        r, items, read = self.random, [], []
        images = [image for image in block.images if image.name.startswith("A")]
        for name, axis in (("roll", [1.0, 0.03, -0.02]), ("pitch", [0.02, 0.1, 1.0])):
            axis = np.array(axis) / np.linalg.norm(axis)
            free, is_fixed = ((), True) if r.random() < 0.4 else ((0,), False)
            items.append(Clinometer(name, axis, is_fixed, np.array([0.0, 1.0, 0.0, 0.0]), free))
            sigma = float(10 ** r.uniform(-4.5, -3.5))
            for image in images:
                angle = float(np.arcsin(np.clip((image.turn @ axis)[2], -0.99, 0.99)))
                if abs(angle) < np.radians(80):
                    read.append((name, image.name, angle + r.normal(0, sigma), sigma))
        block.clinometers = tuple(item for item in items if any(entry[0] == item.name for entry in read))
        block.inclinations = tuple(read)

    def start(self, block):
        """Starts away from the truth."""
        r = self.random
        for p in block.points:
            free = np.isnan(p.sigmas)
            p.start = np.where(free, p.true + r.normal(0, 3e-3 * self.size, 3), p.given)
            p.given = p.start
        block.__dict__.pop("given", None)
        block.images = [
            Image(
                i.name,
                i.camera,
                i.centre + r.normal(0, 3e-3 * self.size, 3),
                rotation(r.normal(0, 3e-3, 3)) @ i.turn,
            )
            for i in block.images
        ]
        moved = np.array([0.003, 0.0, 0.0, *np.zeros(7)])
        if "F" not in block.frozen:
            block.cameras = {name: values * (1 + moved) for name, values in block.cameras.items()}
        if block.places:
            centre, turn = block.places["B"]
            block.places = {
                "B": (centre + r.normal(0, 1e-4 * self.size, 3), rotation(r.normal(0, 1e-3, 3)) @ turn)
            }


def block_case(seed):
    """The block of a seed."""
    return BlockMaker(seed).made()
