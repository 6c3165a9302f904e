// What the observations leave undetermined: arrows at points that may move without any residual.

const FARTHEST = 34;
const UPWARDS = 0.1;

/** Motions of a free network, from the table of them: the points that each moves, and how. */
class Motions {
  constructor(table) {
    const motion = columnOf(table, "motion");
    this.names = motion?.choices ?? [];
    const [point, ...axes] = ["point", "x", "y", "z"].map((key) => columnOf(table, key));
    this.moves = (motion?.values ?? []).map((k, row) => ({ motion: k, point: point.values[row], move: axes.map((axis) => axis.values[row]) }));
  }

  /** Shows the motions that are no shift of all points (so many) alike. */
  choose(count) {
    this.shown = new Set(this.names.map((_, k) => k).filter((k) => {
      const own = this.moves.filter(({ motion }) => motion === k);
      return own.length < count || own.some(({ move }) => distance(move, own[0].move) > 0);
    }));
  }

  /** Arrows of the motions that are shown; where points are crowded, of those that find room. */
  draw(plan, sheet) {
    const room = plan.isCrowded ? new Room(3) : null;
    const free = new Map();
    const [cos, sin] = plan.content.turn ?? [1, 0];
    const hasRoom = ([, x, y]) => !room || room.take(x - FARTHEST, y - FARTHEST, 2 * FARTHEST, 2 * FARTHEST);
    for (const place of plan.inside) if (hasRoom(place)) free.set(place[0], place);
    for (const k of this.shown) {
      const path = sheet.path();
      for (const { motion, point, move } of this.moves) {
        if (motion === k && free.has(point)) loose(path, ...free.get(point).slice(1), [cos * move[0] - sin * move[1], sin * move[0] + cos * move[1], move[2]]);
      }
      sheet.stroke(path, TYPE_COLOURS[k % TYPE_COLOURS.length], 1.8);
    }
  }
}

/** An arrow for a motion in the plane; for one along the vertical, a ring with a dot in it. */
function loose(path, x, y, [east, north, up]) {
  if (Math.hypot(east, north) > UPWARDS * Math.abs(up)) arrow(path, x, y, x + FARTHEST * east, y - FARTHEST * north);
  else for (const radius of [1, 6 + 4 * Math.abs(up)]) disc(path, x, y, radius);
}

/** At points that are left out: both ways along what nothing holds. */
function drawLoose(plan, sheet) {
  const path = sheet.path();
  for (const [point, ...direction] of plan.content.loose) {
    for (const sign of [1, -1]) loose(path, ...plan.place(point), direction.map((part) => sign * part));
  }
  sheet.stroke(path, colour("sel"), 1.8);
}
