// The plan of the network, on a canvas: it is moved and enlarged, its layers are switched, points and sights are picked.

const KNOWN = 1;
const STATION = 2;
const UNDETERMINED = 4;
const RAY = 60;
const MOST_UNPLACED = 30;
const PALETTES = {
  light: { paper: "#ffffff", ink: "#1b1f24", sight: "#7d8894", known: "#b3261e", station: "#0a58b5", free: "#2f3841", ellipse: "#b3261e", moved: "#00695c", picked: "#d97a00" },
  dark: { paper: "#14171b", ink: "#e6e9ed", sight: "#77828e", known: "#ff8a80", station: "#82b7ff", free: "#d5dae0", ellipse: "#ff8a80", moved: "#4fd8c4", picked: "#ffc247" },
};
const TYPE_COLOURS = ["#4477aa", "#cc6677", "#228833", "#b8860b", "#66a5c9", "#aa3377", "#888888", "#e07b39", "#44aa99", "#8866cc"];
const CLASSES = {
  redundancy: { limits: [0.1, 0.3, 0.5, 0.8], colours: ["#c51b7d", "#e9761f", "#c9a800", "#5aae61", "#2b7bba"], texts: ["< 0.1", "0.1 to 0.3", "0.3 to 0.5", "0.5 to 0.8", "> 0.8"] },
  standardised: { limits: [1, 2, 3.29, 5], colours: ["#2b7bba", "#5aae61", "#c9a800", "#e9761f", "#c51b7d"], texts: ["< 1", "1 to 2", "2 to 3.3", "3.3 to 5", "> 5"] },
};
const MARGIN = 40;
const NEAR = 12;
const MOST_NAMES = 600;

class Plan {
  constructor(canvas, content, names, sights, motions, select) {
    Object.assign(this, { canvas, content, names, sights, motions, select });
    this.context = canvas.getContext("2d");
    this.typeOf = sights.typeOf;
    this.layers = { names: true, ellipses: true, moved: false };
    this.visible = new Set(sights.types.map((_, k) => k));
    this.colouring = "none";
    this.enlarged = 1;
    this.selection = {};
    this.pointers = new Map();
    this.measure();
    this.listen();
    this.fit();
  }

  /** What does not change: the middle, the extent, the distance of neighbours, sizes of ellipses. */
  measure() {
    const { x, y, major } = this.content;
    this.drawn = x.map((value, k) => k).filter((k) => x[k] !== null && y[k] !== null);
    this.box = [x, y].map((values) => extent(this.drawn, values));
    const [wide, tall] = this.box.map(([low, high]) => Math.max(high - low, 1e-3));
    const area = Math.max(wide, tall / 20) * Math.max(tall, wide / 20);
    this.spacing = Math.sqrt(area / Math.max(this.drawn.length, 1));
    this.usual = high(major, 0.95);
    this.reach = Math.min(this.spacing * 0.6, Math.max(wide, tall) * 0.15);
    this.farthest = high(this.content.moved?.map((shift) => (shift ? Math.hypot(...shift) : null)), 0.95);
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const [wide, tall] = this.box.map(([low, top]) => top - low || 1e-3);
    this.scale = Math.max(Math.min((width - 2 * MARGIN) / wide, (height - 2 * MARGIN) / tall), 1e-9);
    if (!Number.isFinite(this.scale)) this.scale = 1;
    this.middle = this.box.map(([low, top]) => (Number.isFinite(low) ? (low + top) / 2 : 0));
    this.redraw();
  }

  place(k) {
    return [this.width / 2 + (this.content.x[k] - this.middle[0]) * this.scale, this.height / 2 - (this.content.y[k] - this.middle[1]) * this.scale];
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.draw());
  }

  draw(isPrinting = false) {
    this.waiting = false;
    const ratio = isPrinting ? 2 : window.devicePixelRatio || 1;
    Object.assign(this, { width: this.canvas.clientWidth, height: this.canvas.clientHeight });
    Object.assign(this.canvas, { width: this.width * ratio, height: this.height * ratio });
    this.palette = PALETTES[!isPrinting && document.documentElement.hasAttribute("data-dark") ? "dark" : "light"];
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.context.fillStyle = this.palette.paper;
    this.context.fillRect(0, 0, this.width, this.height);
    this.put();
    this.drawSights();
    if (this.layers.ellipses) this.drawEllipses();
    if (this.layers.moved) this.drawMoved();
    this.drawPoints();
    this.drawRays();
    this.motions.draw(this);
    drawLoose(this);
    this.drawSelection();
    if (this.layers.names) this.drawNames();
    this.drawScale();
    this.describe();
  }

  /** Where each point is on the canvas; those that are seen. */
  put() {
    const { at, inside } = Object.assign(this, { at: new Array(this.names.length), inside: [] });
    for (const k of this.drawn) {
      const [x, y] = (at[k] = this.place(k));
      if (x > -50 && y > -50 && x < this.width + 50 && y < this.height + 50) inside.push([k, x, y]);
    }
  }

  /** Lines of sight, gathered by colour. */
  drawSights() {
    const lines = new Map();
    let count = 0;
    for (const pair of this.sights.list) {
      const [from, to] = [this.at[pair.a], this.at[pair.b]];
      if (!from || !to || this.isOutside(from, to)) continue;
      if (!pair.types.some((type) => this.visible.has(type))) continue;
      count += 1;
      if (this.colouring === "none") addLine(lines, this.palette.sight, !pair.used, from, to, 0);
      else for (const [colour, shift] of this.sightColours(pair)) addLine(lines, colour, !pair.used, from, to, shift);
    }
    this.stroke(lines, count);
  }

  sightColours(pair) {
    const types = pair.types.filter((type) => this.visible.has(type));
    if (this.colouring === "type") return types.map((type, k) => [TYPE_COLOURS[type % TYPE_COLOURS.length], 2 * (k - (types.length - 1) / 2)]);
    const value = this.sights.worst(pair, this.colouring, this.visible, this.typeOf);
    const { limits, colours } = CLASSES[this.colouring];
    return [[value === null ? this.palette.sight : colours[limits.filter((limit) => value >= limit).length], 0]];
  }

  stroke(lines, count) {
    const thin = count > 1500 && this.isCrowded;
    this.context.globalAlpha = this.colouring === "none" ? (thin ? 0.4 : 0.75) : 0.9;
    this.context.lineWidth = this.colouring === "none" ? (thin ? 0.5 : 0.9) : thin ? 0.9 : 1.7;
    for (const { colour, isDashed, paths } of lines.values()) {
      this.context.strokeStyle = colour;
      this.context.setLineDash(isDashed ? [4, 4] : []);
      for (const path of paths) this.context.stroke(path);
    }
    this.context.setLineDash([]);
    this.context.globalAlpha = 1;
  }

  isOutside(a, b) {
    return Math.max(a[0], b[0]) < 0 || Math.max(a[1], b[1]) < 0 || Math.min(a[0], b[0]) > this.width || Math.min(a[1], b[1]) > this.height;
  }

  /** How many times ellipses are larger than life: the usual one reaches half way to its neighbour. */
  get ellipseFactor() {
    return this.usual > 0 ? this.enlarged * roundBelow(Math.max(this.reach, 11 / this.scale) / this.usual) : 1;
  }

  get isCrowded() {
    return this.spacing * this.scale < 12;
  }

  get movedFactor() {
    return this.farthest > 0 ? this.enlarged * roundBelow((0.8 * Math.max(this.spacing, 18 / this.scale)) / this.farthest) : 1;
  }

  /** Ellipses; where points are crowded only those that find room, the largest first. */
  drawEllipses() {
    const { major, minor, bearing } = this.content;
    const factor = this.ellipseFactor * this.scale;
    const path = new Path2D();
    const room = this.isCrowded ? new Room(2) : null;
    const chosen = room ? [...this.inside].sort((a, b) => (major[b[0]] ?? 0) - (major[a[0]] ?? 0)) : this.inside;
    for (const [k, x, y] of chosen) {
      const long = (major[k] ?? 0) * factor;
      if (long < 0.7) continue;
      if (room && !room.take(x - long, y - long, 2 * long, 2 * long)) continue;
      const turn = bearing[k] - Math.PI / 2;
      path.moveTo(x + long * Math.cos(turn), y + long * Math.sin(turn));
      path.ellipse(x, y, long, minor[k] * factor, turn, 0, 2 * Math.PI);
    }
    Object.assign(this.context, { strokeStyle: this.palette.ellipse, lineWidth: 1 });
    this.context.stroke(path);
  }

  /** Arrows from where a point was to where it is, enlarged. */
  drawMoved() {
    const factor = this.movedFactor * this.scale;
    const path = new Path2D();
    for (const [k, x, y] of this.inside) {
      const shift = this.content.moved[k];
      if (shift) arrow(path, x, y, x + shift[0] * factor, y - shift[1] * factor);
    }
    Object.assign(this.context, { strokeStyle: this.palette.moved, lineWidth: 1.6 });
    this.context.stroke(path);
  }

  get markSize() {
    return Math.max(1.3, Math.min(5.5, 0.22 * this.spacing * this.scale));
  }

  /** Known points are triangles, stations circles, the others dots; what nothing determines is a cross. */
  drawPoints() {
    const size = this.markSize;
    const paths = { known: new Path2D(), station: new Path2D(), free: new Path2D(), undetermined: new Path2D() };
    for (const [k, x, y] of this.inside) {
      const marks = this.content.marks[k];
      if (marks & UNDETERMINED) cross(paths.undetermined, x, y, size * 1.3);
      else if (marks & KNOWN) triangle(paths.known, x, y, Math.max(size * 1.7, 4.5));
      else if (!(marks & STATION)) disc(paths.free, x, y, size * 0.6);
      if (marks & STATION) disc(paths.station, x, y, size * (marks & KNOWN ? 0.5 : 1));
    }
    const { context, palette } = this;
    Object.assign(context, { lineWidth: Math.max(0.8, size / 3), fillStyle: palette.free, strokeStyle: palette.station });
    context.fill(paths.free);
    context.fillStyle = palette.paper;
    context.fill(paths.known);
    context.fill(paths.station);
    context.stroke(paths.station);
    context.strokeStyle = palette.known;
    context.stroke(paths.known);
    context.stroke(paths.undetermined);
  }

  /** Sights to points without a place: a dashed ray of a length that says nothing, with the name at its end. */
  drawRays() {
    const { context, palette } = this;
    Object.assign(context, { strokeStyle: palette.known, fillStyle: palette.ink, lineWidth: 1.2, font: "12px system-ui, sans-serif", textBaseline: "middle" });
    context.setLineDash([6, 4]);
    for (const [point, east, north, name] of this.content.rays) {
      const [x, y] = this.place(point);
      const path = new Path2D();
      arrow(path, x, y, x + RAY * east, y - RAY * north);
      context.stroke(path);
      context.fillText(`${name}?`, x + (RAY + 8) * east, y - (RAY + 8) * north);
    }
    context.setLineDash([]);
  }

  drawSelection() {
    const { context, selection, palette } = this;
    const points = selection.points ?? [];
    Object.assign(context, { strokeStyle: palette.picked, lineWidth: 3 });
    if (points.length === 2) {
      const path = new Path2D();
      path.moveTo(...this.place(points[0]));
      path.lineTo(...this.place(points[1]));
      context.stroke(path);
    }
    for (const point of points) {
      const path = new Path2D();
      disc(path, ...this.place(point), this.markSize + 5);
      context.stroke(path);
    }
  }

  /** The names that find room: the selected ones first, then known points, stations and the others. */
  drawNames() {
    const { context, palette } = this;
    const picked = new Set(this.selection.points ?? []);
    const rank = (k) => (picked.has(k) ? 0 : this.content.marks[k] & (KNOWN | UNDETERMINED) ? 1 : this.content.marks[k] & STATION ? 2 : 3);
    const room = new Room(this.isCrowded ? 3 : 1);
    Object.assign(context, { font: "12px system-ui, sans-serif", textBaseline: "middle", lineWidth: 3, lineJoin: "round", strokeStyle: palette.paper, fillStyle: palette.ink });
    let count = 0;
    for (const [k, x, y] of [...this.inside].sort((a, b) => rank(a[0]) - rank(b[0]))) {
      if (count >= MOST_NAMES) break;
      if (rank(k) >= 2 && this.isCrowded) break;
      const wide = context.measureText(this.names[k]).width;
      const left = x + this.markSize + 4;
      if (!room.take(left, y - 8, wide, 14)) continue;
      context.strokeText(this.names[k], left, y - 1);
      context.fillText(this.names[k], left, y - 1);
      count += 1;
    }
  }

  drawScale() {
    if (this.content.scheme) return;
    const { context, palette, height } = this;
    const unit = QUANTITIES.length();
    const inUnit = roundBelow((this.width / 5 / this.scale) * unit.factor);
    const length = inUnit / unit.factor;
    context.fillStyle = palette.paper;
    context.fillRect(8, height - 36, length * this.scale + 12, 30);
    context.fillRect(10, 2, 24, 54);
    Object.assign(context, { strokeStyle: palette.ink, fillStyle: palette.ink, lineWidth: 2, font: "12px system-ui, sans-serif", textBaseline: "alphabetic" });
    context.strokeRect(14, height - 14, length * this.scale, 0);
    context.fillText(`${significant(inUnit)} ${unit.unit}`, 14, height - 20);
    context.lineWidth = 1.4;
    const path = new Path2D();
    arrow(path, 22, 52, 22, 20);
    context.stroke(path);
    context.fillText("y", 19, 14);
  }

  /** What the marks and colours mean, below the plan. */
  describe() {
    const large = (factor) => `${this.content.scheme ? "to scale among themselves" : `${significant(factor)} times larger than life`}${this.isCrowded ? ", those that find room (enlarge the plan for the others)" : ""}`;
    const parts = [this.content.title];
    if (this.content.marks.some((marks) => marks & UNDETERMINED)) parts.push("crosses: points that nothing determines");
    const { unplaced } = this.content;
    const more = unplaced.length > MOST_UNPLACED ? ` and ${unplaced.length - MOST_UNPLACED} more (the warnings name them)` : "";
    if (unplaced.length) parts.push(`not determined, and without a place: ${unplaced.slice(0, MOST_UNPLACED).join(", ")}${more}`);
    if (this.content.loose.length) parts.push("arrows at crosses: directions that nothing holds (a ring: the vertical)");
    if (this.motions.shown.size) parts.push("arrows in colours: motions that no observation sees (a ring: along the vertical)");
    if (this.content.rays.length) parts.push("dashed rays: sights to such points");
    if (this.layers.ellipses && this.usual > 0) parts.push(`${this.content.ellipses}, ${large(this.ellipseFactor)}`);
    if (this.layers.moved) parts.push(`${this.content.displacements}, ${large(this.movedFactor)}`);
    this.legend?.(parts.join("; "), this.colouring);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => this.wheeled(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.pressed(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.released(event));
    canvas.addEventListener("keydown", (event) => this.typed(event));
    new ResizeObserver(() => (canvas.clientWidth !== this.width || canvas.clientHeight !== this.height) && this.redraw()).observe(canvas);
  }

  wheeled(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
  }

  /** Enlarges about a place of the canvas. */
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const change = (1 - 1 / factor) / this.scale;
    this.middle = [this.middle[0] + (x - this.width / 2) * change, this.middle[1] - (y - this.height / 2) * change];
    this.scale *= factor;
    this.redraw();
  }

  move(dx, dy) {
    this.middle = [this.middle[0] - dx / this.scale, this.middle[1] + dy / this.scale];
    this.redraw();
  }

  pressed(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    this.dragged = this.pointers.size > 1 ? Infinity : 0;
  }

  moved(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY];
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this.zoom(distance(now, other) / Math.max(distance(before, other), 1), ...other);
    else this.move(now[0] - before[0], now[1] - before[1]);
    this.dragged += distance(now, before);
    this.pointers.set(event.pointerId, now);
  }

  released(event) {
    const wasPressed = this.pointers.delete(event.pointerId);
    if (wasPressed && event.type === "pointerup" && this.dragged < 4) this.pick(event.offsetX, event.offsetY);
  }

  typed(event) {
    const steps = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };
    if (steps[event.key]) this.move(...steps[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.5);
    else if (event.key === "-") this.zoom(1 / 1.5);
    else if (event.key === "0") this.fit();
    else return;
    event.preventDefault();
  }

  /** Selects the point at a place, or else the sight, or nothing. */
  pick(x, y) {
    const point = nearest(this.inside, ([, px, py]) => Math.hypot(px - x, py - y));
    if (point) return this.select({ points: [point[0]], only: { point: point[0] } });
    const lines = this.sights.list.filter((pair) => pair.types.some((type) => this.visible.has(type)));
    const sight = nearest(lines, (pair) => fromLine(this.place(pair.a), this.place(pair.b), x, y), NEAR / 2);
    return this.select(sight ? { points: [sight.a, sight.b], row: sight.rows[0] } : {});
  }

  /** Shows a selection; moves the plan where it would not be seen. */
  follow(selection) {
    this.selection = selection;
    const points = (selection.points ?? []).filter((point) => this.content.x[point] !== null);
    this.selection.points = points;
    const isSeen = points.every((point) => this.isInside(...this.place(point)));
    if (points.length && !isSeen) this.middle = ["x", "y"].map((axis) => points.reduce((sum, k) => sum + this.content[axis][k], 0) / points.length);
    this.redraw();
  }

  isInside(x, y) {
    return x > 0 && y > 0 && x < this.width && y < this.height;
  }
}
