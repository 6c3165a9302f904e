// Shapes and distances on a sheet, in its units; sheets: a canvas, or the text of an SVG.

const MOST_LINES = 1000;
const HERE = [0, 0];
const FONT = "system-ui, sans-serif";

/** What is drawn on a canvas. */
class CanvasSheet {
  constructor(context, width, height) {
    Object.assign(this, { context, width, height });
  }

  path() {
    return new Path2D();
  }

  stroke(path, style, width, { dash = [], alpha = 1 } = {}) {
    Object.assign(this.context, { strokeStyle: style, lineWidth: width, globalAlpha: alpha });
    this.context.setLineDash(dash);
    this.context.stroke(path);
    this.context.setLineDash([]);
    this.context.globalAlpha = 1;
  }

  fill(path, style, alpha = 1) {
    Object.assign(this.context, { fillStyle: style, globalAlpha: alpha });
    this.context.fill(path);
    this.context.globalAlpha = 1;
  }

  text(text, x, y, { style, size = 12, weight = 400, anchor = "left", halo = null }) {
    Object.assign(this.context, { font: `${weight} ${size}px ${FONT}`, textAlign: anchor, fillStyle: style });
    if (halo) {
      Object.assign(this.context, { strokeStyle: halo, lineWidth: 3.5, lineJoin: "round" });
      this.context.strokeText(text, x, y);
    }
    this.context.fillText(text, x, y);
  }

  wide(text, size, weight) {
    this.context.font = `${weight} ${size}px ${FONT}`;
    return this.context.measureText(text).width;
  }
}

/** A path of an SVG, made by the same calls as that of a canvas. */
class SvgPath {
  d = "";

  moveTo(x, y) {
    this.d += `M${x.toFixed(1)} ${y.toFixed(1)}`;
  }

  lineTo(x, y) {
    this.d += `L${x.toFixed(1)} ${y.toFixed(1)}`;
  }

  closePath() {
    this.d += "Z";
  }

  rect(x, y, width, height) {
    this.d += `M${x.toFixed(1)} ${y.toFixed(1)}h${width.toFixed(1)}v${height.toFixed(1)}h${(-width).toFixed(1)}Z`;
  }

  arc(x, y, radius) {
    this.ellipse(x, y, radius, radius, 0);
  }

  ellipse(x, y, long, short, turn) {
    const [dx, dy] = [long * Math.cos(turn), long * Math.sin(turn)];
    const half = `A${long.toFixed(2)} ${short.toFixed(2)} ${(turn * 180 / Math.PI).toFixed(1)} 1 1 `;
    this.d += `M${(x + dx).toFixed(2)} ${(y + dy).toFixed(2)}${half}${(x - dx).toFixed(2)} ${(y - dy).toFixed(2)}${half}${(x + dx).toFixed(2)} ${(y + dy).toFixed(2)}Z`;
  }
}

/** The same drawing as elements of an SVG: for paper, and to be saved. */
class SvgSheet {
  constructor(width, height) {
    Object.assign(this, { width, height, root: svg("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "plan" }) });
  }

  path() {
    return new SvgPath();
  }

  stroke(path, style, width, { dash = [], alpha = 1 } = {}) {
    if (path.d) this.root.append(svg("path", { d: path.d, fill: "none", stroke: style, "stroke-width": width, opacity: alpha, ...(dash.length ? { "stroke-dasharray": dash.join(" ") } : {}) }));
  }

  fill(path, style, alpha = 1) {
    if (path.d) this.root.append(svg("path", { d: path.d, fill: style, opacity: alpha }));
  }

  text(text, x, y, { style, size = 12, weight = 400, anchor = "left" }) {
    const place = { left: "start", center: "middle", right: "end" }[anchor];
    this.root.append(svg("text", { x: x.toFixed(1), y: y.toFixed(1), "font-size": size, "font-weight": weight, "font-family": "sans-serif", fill: style, "text-anchor": place }, [text]));
  }

  wide(text, size) {
    return text.length * size * 0.55;
  }
}

/** A disc; one of a pixel or two is a square, which is drawn faster and looks the same. */
function disc(path, x, y, radius) {
  if (radius < 1.5) {
    path.rect(x - radius, y - radius, 2 * radius, 2 * radius);
    return;
  }
  path.moveTo(x + radius, y);
  path.arc(x, y, radius, 0, 2 * Math.PI);
}

function ring(path, x, y, long, short, turn) {
  path.moveTo(x + long * Math.cos(turn), y + long * Math.sin(turn));
  path.ellipse(x, y, long, short, turn, 0, 2 * Math.PI);
}

/** A camera from above. */
function trapezium(path, x, y, radius) {
  path.moveTo(x - radius, y + 0.6 * radius);
  path.lineTo(x + radius, y + 0.6 * radius);
  path.lineTo(x + 0.4 * radius, y - 0.8 * radius);
  path.lineTo(x - 0.4 * radius, y - 0.8 * radius);
  path.closePath();
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

/** Adds a line to those of its look, in paths of not too many lines: long ones are slow to draw. */
function addLine(sheet, lines, look, from, to, shift) {
  const key = `${look.style} ${look.width} ${look.isDashed}`;
  let found = lines.get(key);
  if (!found) lines.set(key, (found = { ...look, paths: [], count: 0 }));
  if (found.count % MOST_LINES === 0) found.paths.push(sheet.path());
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

/** The smallest 1, 2 or 5 times a power of ten that is not below a value. */
function roundAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * (1 - 1e-12)) ?? 10 * power;
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

  /** Takes a rectangle, whether or not it is free. */
  fill(x, y, width, height) {
    for (const key of this.keys(x, y, width, height)) this.cells.add(key);
  }

  isFree(x, y, width, height) {
    return !this.keys(x, y, width, height).some((key) => this.cells.has(key));
  }

  /** Takes a rectangle that is free; whether it was. */
  take(x, y, width, height) {
    const isFree = this.isFree(x, y, width, height);
    if (isFree) this.fill(x, y, width, height);
    return isFree;
  }

  keys(x, y, width, height) {
    const [wide, tall] = this.size;
    const keys = [];
    for (let i = Math.floor(x / wide); i <= Math.floor((x + width) / wide); i += 1) {
      for (let j = Math.floor(y / tall); j <= Math.floor((y + height) / tall); j += 1) keys.push(i * 100000 + j);
    }
    return keys;
  }
}
