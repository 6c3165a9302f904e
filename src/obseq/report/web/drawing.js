// Shapes and distances on the canvas, in its units.

const MOST_LINES = 1000;
const HERE = [0, 0];

function disc(path, x, y, radius) {
  path.moveTo(x + radius, y);
  path.arc(x, y, radius, 0, 2 * Math.PI);
}

function triangle(path, x, y, radius) {
  path.moveTo(x, y - radius);
  path.lineTo(x + 0.87 * radius, y + 0.5 * radius);
  path.lineTo(x - 0.87 * radius, y + 0.5 * radius);
  path.closePath();
}

function cross(path, x, y, radius) {
  path.moveTo(x - radius, y - radius);
  path.lineTo(x + radius, y + radius);
  path.moveTo(x - radius, y + radius);
  path.lineTo(x + radius, y - radius);
}

function arrow(path, x, y, toX, toY) {
  const length = Math.hypot(toX - x, toY - y);
  const size = Math.min(7, length / 2);
  const turn = Math.atan2(toY - y, toX - x);
  path.moveTo(x, y);
  path.lineTo(toX, toY);
  for (const side of [-0.45, 0.45]) {
    path.moveTo(toX, toY);
    path.lineTo(toX - size * Math.cos(turn + side), toY - size * Math.sin(turn + side));
  }
}

/** Adds a line to those of its colour, in paths of not too many lines: long ones are slow to draw. */
function addLine(lines, colour, isDashed, from, to, shift) {
  const key = isDashed ? `${colour} dashed` : colour;
  let found = lines.get(key);
  if (!found) lines.set(key, (found = { colour, isDashed, paths: [], count: 0 }));
  if (found.count % MOST_LINES === 0) found.paths.push(new Path2D());
  found.count += 1;
  const path = found.paths[found.paths.length - 1];
  const aside = shift ? across(from, to, shift) : HERE;
  path.moveTo(from[0] + aside[0], from[1] + aside[1]);
  path.lineTo(to[0] + aside[0], to[1] + aside[1]);
}

/** The smallest and largest of some values. */
function extent(rows, values) {
  let [low, top] = [Infinity, -Infinity];
  for (const row of rows) {
    if (values[row] < low) low = values[row];
    if (values[row] > top) top = values[row];
  }
  return [low, top];
}

const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** A shift across a line, so that lines of one pair of points lie side by side. */
function across(from, to, shift) {
  const length = distance(from, to) || 1;
  return [(-(to[1] - from[1]) / length) * shift, ((to[0] - from[0]) / length) * shift];
}

/** How far a place is from a segment. */
function fromLine(a, b, x, y) {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const along = Math.max(0, Math.min(1, ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(a[0] + along * dx - x, a[1] + along * dy - y);
}

/** The item that is nearest, within reach. */
function nearest(items, far, reach = NEAR) {
  let [found, least] = [null, reach];
  for (const item of items) {
    const length = far(item);
    if (length < least) [found, least] = [item, length];
  }
  return found;
}

/** The largest 1, 2 or 5 times a power of ten that is not above a value. */
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((step) => step * power).find((step) => step <= value * (1 + 1e-12)) ?? power;
}

/** The value below which a share of the numbers lies. */
function high(values, share) {
  const ordered = (values ?? []).filter((value) => value > 0).sort((a, b) => a - b);
  return ordered.length ? ordered[Math.min(ordered.length - 1, Math.floor(share * ordered.length))] : 0;
}

/** Rectangles on the canvas that are taken, found by cells; coarse cells keep them farther apart. */
class Room {
  constructor(coarseness = 1) {
    this.cells = new Set();
    this.size = [12 * coarseness, 7 * coarseness];
  }

  take(x, y, width, height) {
    const [wide, tall] = this.size;
    const keys = [];
    for (let i = Math.floor(x / wide); i <= Math.floor((x + width) / wide); i += 1) {
      for (let j = Math.floor(y / tall); j <= Math.floor((y + height) / tall); j += 1) keys.push(i * 100000 + j);
    }
    if (keys.some((key) => this.cells.has(key))) return false;
    for (const key of keys) this.cells.add(key);
    return true;
  }
}
