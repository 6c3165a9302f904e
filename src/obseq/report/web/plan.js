// The plan: it is moved and enlarged, its layers are switched, points and sights are picked.

const [KNOWN, STATION, UNDETERMINED, CAMERA] = [1, 2, 4, 8];
const RAY = 60;
const NEAR = 12;
const MARGIN = 44;
const BARS = 30;
const MOST_NAMES = 600;
/** Pixels of the narrowest name: where it has no room, none has. */
const LEAST_NAME = 4;
const MOST_UNPLACED = 30;
const MOST_SIGHTS = 20000;
/** Sights that hide points and names unless they are pale. */
const MANY_SIGHTS = 1000;
const TYPE_COLOURS = ["#4477aa", "#cc6677", "#228833", "#b8860b", "#66a5c9", "#aa3377", "#888888", "#e07b39", "#44aa99", "#8866cc"];
const PLACES_OF_NAMES = [[9, 4, 0], [-9, 4, 1], [0, -11, 0.5], [0, 20, 0.5], [8, -8, 0], [8, 16, 0], [-8, -8, 1], [-8, 16, 1]];

class Plan {
  constructor(canvas, content, names, sights, motions, choose) {
    Object.assign(this, { canvas, content, names, sights, motions, choose });
    this.context = canvas.getContext("2d");
    this.layers = { names: true, ellipses: true, moved: content.isMoved ?? false, residuals: false, sights: true, grid: !content.scheme };
    this.visible = new Set(sights.types.length ? sights.types.map((_, k) => k) : [0]);
    this.colouring = "none";
    this.enlarged = 1;
    this.selection = {};
    this.pointers = new Map();
    this.suspected = new Set(content.suspected ?? []);
    this.measure();
    this.listen();
    this.resize();
    this.fit();
  }

  get hasResiduals() {
    return Boolean(this.sights.residual) && (this.sights.aside.size > 0 || this.sights.ahead.size > 0);
  }

  /** What does not change: the extent, the distance of neighbours, sizes of ellipses and residuals. */
  measure() {
    const { x, y, major, moved } = this.content;
    this.drawn = x.map((_, k) => k).filter((k) => x[k] !== null && y[k] !== null);
    this.box = [x, y].map((values) => extent(this.drawn, values));
    const [wide, tall] = this.box.map(([low, top]) => Math.max(top - low, 1e-3));
    this.spacing = Math.sqrt(Math.max(wide, tall / 20) * Math.max(tall, wide / 20) / Math.max(this.drawn.length, 1));
    this.usual = high(major, 0.5);
    this.largest = high(major, 1);
    this.farthest = high(moved?.map((shift) => (shift ? Math.hypot(...shift) : null)), 0.95);
    this.shifts = new Map();
    if (this.hasResiduals) for (const pair of this.sights.list) if (pair.used) this.shifts.set(pair, this.sights.shift(pair, x, y));
    this.longest = high([...this.shifts.values()].map((shift) => Math.hypot(...shift)), 1);
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    Object.assign(this, { width: this.canvas.clientWidth, height: this.canvas.clientHeight });
    Object.assign(this.canvas, { width: this.width * ratio, height: this.height * ratio });
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  fit() {
    const [wide, tall] = this.box.map(([low, top]) => top - low || 1e-3);
    let margin = MARGIN;
    for (let round = 0; round < 3; round += 1) { // ellipses and displacements need room, and depend on the scale
      const room = [this.width - 2 * margin - 50, this.height - 2 * margin - BARS];
      this.scale = Math.max(Math.min(room[0] / wide, room[1] / tall), 1e-9);
      if (!Number.isFinite(this.scale)) this.scale = 1;
      this.whole = this.scale;
      const reach = this.largest + (this.layers.moved ? this.farthest : 0);
      margin = Math.max(MARGIN - 16, Math.min(reach * this.ellipseScale + 8, this.height / 4));
    }
    this.middle = this.box.map(([low, top]) => (Number.isFinite(low) ? (low + top) / 2 : 0));
    this.redraw();
  }

  place(k) {
    return [this.width / 2 + (this.content.x[k] - this.middle[0]) * this.scale, (this.height - BARS + 14) / 2 - (this.content.y[k] - this.middle[1]) * this.scale];
  }

  /** The place in the plane of one on the canvas. */
  at(x, y) {
    return [this.middle[0] + (x - this.width / 2) / this.scale, this.middle[1] - (y - (this.height - BARS + 14) / 2) / this.scale];
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      if (this.width) this.paint(new CanvasSheet(this.context, this.width, this.height));
      this.changed?.();
    });
  }

  /** The whole plan as an SVG element, without any selection. */
  svg(width, height) {
    const kept = { width: this.width, height: this.height, middle: this.middle, scale: this.scale, whole: this.whole, selection: this.selection };
    Object.assign(this, { width, height, selection: {} });
    this.fit();
    const sheet = new SvgSheet(width, height);
    this.paint(sheet);
    Object.assign(this, kept);
    return sheet.root;
  }

  paint(sheet) {
    const ground = sheet.path();
    ground.rect(0, 0, sheet.width, sheet.height);
    sheet.fill(ground, colour("sf"));
    this.put();
    this.drawDensity(sheet);
    if (this.layers.grid) this.drawGrid(sheet);
    if (this.layers.sights) this.drawSights(sheet);
    if (this.layers.residuals) this.drawResiduals(sheet);
    if (this.layers.ellipses) this.drawEllipses(sheet);
    if (this.layers.moved) this.drawMoved(sheet);
    this.drawRays(sheet);
    this.motions.draw(this, sheet);
    drawLoose(this, sheet);
    this.drawPoints(sheet);
    this.drawSelection(sheet);
    if (this.layers.names) this.drawNames(sheet);
    this.drawBars(sheet);
  }

  /** Where each point is on the canvas; those that are seen. */
  put() {
    const { placed, inside } = Object.assign(this, { placed: new Array(this.names.length), inside: [] });
    for (const k of this.drawn) {
      const [x, y] = (placed[k] = this.place(k));
      if (x > -50 && y > -50 && x < this.width + 50 && y < this.height + 50) inside.push([k, x, y]);
    }
  }

  /** Of a large network, how many points there are in each cell: the darker the more. */
  drawDensity(sheet) {
    const { corner, step, cells } = this.content.density ?? { cells: [] };
    const most = Math.max(...cells.map(([, , count]) => count));
    const paths = [1, 2, 3, 4].map(() => sheet.path());
    for (const [column, row, count] of cells) {
      const x = this.width / 2 + (corner[0] + column * step - this.middle[0]) * this.scale;
      const y = (this.height - BARS + 14) / 2 - (corner[1] + (row + 1) * step - this.middle[1]) * this.scale;
      paths[Math.ceil((4 * count) / most) - 1].rect(x, y, step * this.scale, step * this.scale);
    }
    paths.forEach((path, k) => sheet.fill(path, colour("mu"), 0.08 * (k + 1)));
  }

  /** Coordinates at round numbers. */
  drawGrid(sheet) {
    const step = roundAbove(110 / this.scale);
    const unit = quantity("length");
    const decimals = Math.max(0, -Math.floor(Math.log10(step * unit.factor) + 1e-9));
    const [path, ink] = [sheet.path(), colour("mu")];
    const [[left, top], [right, bottom]] = [this.at(0, 0), this.at(this.width, this.height)];
    const shown = (value) => grouped(fixed(value * unit.factor, decimals));
    for (let value = Math.ceil(left / step) * step; value < right; value += step) {
      const x = this.width / 2 + (value - this.middle[0]) * this.scale;
      path.moveTo(x, 0);
      path.lineTo(x, this.height);
      if (x > 70 && x < this.width - 40) sheet.text(shown(value), x, 12, { style: ink, size: 10.5, anchor: "center" });
    }
    for (let value = Math.ceil(bottom / step) * step; value < top; value += step) {
      const y = (this.height - BARS + 14) / 2 - (value - this.middle[1]) * this.scale;
      path.moveTo(0, y);
      path.lineTo(this.width, y);
      if (y > 24 && y < this.height - 80) sheet.text(shown(value), this.width - 6, y - 3, { style: ink, size: 10.5, anchor: "right" });
    }
    sheet.stroke(path, colour("grid"), 1);
  }

  /** Lines of sight, gathered by their look; suspected ones last. */
  drawSights(sheet) {
    const lines = new Map();
    const hot = [];
    let count = 0;
    for (const pair of this.sights.list) {
      const [from, to] = [this.placed[pair.a], this.placed[pair.b]];
      if (!from || !to || this.isOutside(from, to) || !pair.types.some((type) => this.visible.has(type))) continue;
      count += 1;
      if (count > MOST_SIGHTS) break;
      if (pair.isHot) hot.push([from, to]);
      else for (const [look, shift] of this.looks(pair)) addLine(sheet, lines, look, from, to, shift);
    }
    this.isCut = count > MOST_SIGHTS;
    const alpha = this.selection.points?.length || count > MANY_SIGHTS ? 0.35 : 0.8;
    for (const { style, width, isDashed, paths } of lines.values()) {
      for (const path of paths) sheet.stroke(path, style, width, { dash: isDashed ? [5, 4] : [], alpha });
    }
    const path = sheet.path();
    for (const [from, to] of hot) {
      path.moveTo(...from);
      path.lineTo(...to);
    }
    sheet.stroke(path, colour("bad"), 2.4);
  }

  /** How a pair is drawn, and how far aside. */
  looks(pair) {
    const isDashed = !pair.used;
    if (this.colouring === "type") {
      const types = pair.types.filter((type) => this.visible.has(type));
      return types.map((type, k) => [{ style: TYPE_COLOURS[type % TYPE_COLOURS.length], width: 1.5, isDashed }, 2 * (k - (types.length - 1) / 2)]);
    }
    const value = this.colouring === "none" ? null : this.sights.worst(pair, this.colouring, this.visible);
    const found = value === null ? null : this.classes().find(({ from, to }) => value >= from && value < to);
    return [[found ? { style: colour(found.name), width: found.width, isDashed } : { style: colour("sight"), width: 0.9, isDashed }, 0]];
  }

  /** Classes of the colours of sights: by redundancy, or by w beside its limit. */
  classes() {
    if (this.colouring === "redundancy") {
      return [{ from: 0, to: 0.1, name: "bad", width: 3, text: "redundancy < 0.1" }, { from: 0.1, to: 0.3, name: "wl", width: 1.8, text: "< 0.3" }, { from: 0.3, to: Infinity, name: "ok", width: 0.9, text: "checked" }];
    }
    const limit = this.content.limit ?? 3.29;
    return [{ from: limit, to: Infinity, name: "bad", width: 3, text: `w beyond ${fixed(limit, 2)}` }, { from: limit / 2, to: limit, name: "wl", width: 1.8, text: "beyond half of it" }, { from: 0, to: limit / 2, name: "sight", width: 0.9, text: "smaller" }];
  }

  isOutside(a, b) {
    return Math.max(a[0], b[0]) < 0 || Math.max(a[1], b[1]) < 0 || Math.min(a[0], b[0]) > this.width || Math.min(a[1], b[1]) > this.height;
  }

  /** Pixels a metre of ellipses and displacements: usual ones are well seen, the largest stay within the plan. */
  get ellipseScale() {
    const least = Math.min(this.width, this.height);
    const usual = this.usual > 0 ? Math.min(Math.max(8, 0.6 * this.spacing * this.whole), 26) / this.usual : Infinity;
    const largest = this.largest > 0 ? 0.11 * least / this.largest : Infinity;
    const moved = this.layers.moved && this.farthest > 0 ? 0.16 * least / this.farthest : Infinity;
    const found = Math.min(usual, largest, moved);
    return Number.isFinite(found) ? found * this.enlarged : 1;
  }

  get residualScale() {
    return this.longest > 0 ? 0.11 * Math.min(this.width, this.height) / this.longest * this.enlarged : 1;
  }

  get isCrowded() {
    return this.spacing * this.scale < 12;
  }

  /** Ellipses; where points are crowded only those that find room, the largest first. */
  drawEllipses(sheet) {
    const { major, minor, bearing, moved } = this.content;
    const factor = this.ellipseScale;
    const [path, room] = [sheet.path(), this.isCrowded ? new Room(2) : null];
    const chosen = room ? [...this.inside].sort((a, b) => (major[b[0]] ?? 0) - (major[a[0]] ?? 0)) : this.inside;
    for (const [k, atX, atY] of chosen) {
      const long = (major[k] ?? 0) * factor;
      if (long < 0.7 || (room && !room.take(atX - long, atY - long, 2 * long, 2 * long))) continue;
      const shift = this.layers.moved && moved?.[k] ? moved[k] : HERE;
      ring(path, atX + shift[0] * factor, atY - shift[1] * factor, long, Math.max(minor[k] * factor, 0.5), bearing[k] - Math.PI / 2);
    }
    sheet.stroke(path, colour("ell"), 1.2);
    sheet.fill(path, colour("ell"), 0.07);
  }

  /** Arrows from where a point was to where it is, enlarged as the ellipses are. */
  drawMoved(sheet) {
    const factor = this.ellipseScale;
    const [usual, hot] = [sheet.path(), sheet.path()];
    for (const [k, x, y] of this.inside) {
      const shift = this.content.moved?.[k];
      if (shift) arrow(this.suspected.has(k) ? hot : usual, x, y, x + shift[0] * factor, y - shift[1] * factor);
    }
    sheet.stroke(usual, colour("vec"), 1.6);
    sheet.stroke(hot, colour("bad"), 2.6);
  }

  /** Residuals of directions and distances, on their sights. */
  drawResiduals(sheet) {
    const [path, factor] = [sheet.path(), this.residualScale];
    for (const [pair, [east, north]] of this.shifts) {
      const [a, b] = [this.placed[pair.a], this.placed[pair.b]];
      if (!a || !b || this.isOutside(a, b) || Math.hypot(east, north) * factor < 2) continue;
      const [x, y] = [0.35 * a[0] + 0.65 * b[0], 0.35 * a[1] + 0.65 * b[1]];
      arrow(path, x, y, x + east * factor, y - north * factor);
    }
    sheet.stroke(path, colour("res"), 1.6);
  }

  get markSize() {
    return Math.max(1.5, Math.min(6, 0.22 * this.spacing * this.scale));
  }

  /** Known points are triangles, stations rings, the others dots; what nothing determines is a cross. */
  drawPoints(sheet) {
    const size = this.markSize;
    const [solid, station, lost, hot] = [sheet.path(), sheet.path(), sheet.path(), sheet.path()];
    for (const [k, x, y] of this.inside) {
      const marks = this.content.marks[k];
      const path = this.suspected.has(k) ? hot : solid;
      if (marks & UNDETERMINED) cross(lost, x, y, size * 1.3);
      else if (marks & CAMERA) trapezium(path, x, y, size * 1.3);
      else if (marks & KNOWN) triangle(path, x, y, Math.max(size * 1.4, 4));
      else if (marks & STATION) disc(station, x, y, size);
      else disc(path, x, y, size * 0.6);
    }
    sheet.stroke(solid, colour("sf"), 1.5);
    sheet.fill(solid, colour("tx"));
    sheet.fill(hot, colour("bad"));
    sheet.fill(station, colour("sf"));
    sheet.stroke(station, colour("tx"), Math.max(1, size / 3));
    sheet.stroke(lost, colour("bad"), 2);
  }

  /** Sights to points without a place: a dashed ray of a length that says nothing. */
  drawRays(sheet) {
    for (const [point, east, north, name] of this.content.rays) {
      const [x, y] = this.place(point);
      const path = sheet.path();
      arrow(path, x, y, x + RAY * east, y - RAY * north);
      sheet.stroke(path, colour("bad"), 1.2, { dash: [6, 4] });
    }
  }

  /** The names at the ends of rays; those without room stand in the legend. */
  nameRays(sheet, room) {
    for (const [point, east, north, name] of this.content.rays) {
      const [text, [x, y]] = [`${name}?`, this.place(point)];
      const wide = sheet.wide(text, 12, 400);
      const [left, base] = [x + (RAY + 8) * east - (east < 0 ? wide : 0), y - (RAY + 8) * north];
      if (this.holds(left, base, wide) && room.take(left - 1, base - 10, wide + 2, 12)) sheet.text(text, left, base, { style: colour("tx"), halo: colour("halo") });
    }
  }

  drawSelection(sheet) {
    const points = this.selection.points ?? [];
    const path = sheet.path();
    if (points.length === 2) {
      path.moveTo(...this.place(points[0]));
      path.lineTo(...this.place(points[1]));
    }
    for (const k of this.hovered === undefined ? points : [...points, this.hovered]) disc(path, ...this.place(k), this.markSize + 5);
    sheet.stroke(path, colour("sel"), 2.6);
  }

  /** The names that find room: the selected ones first, then suspected and known points, stations and the others. */
  drawNames(sheet) {
    const picked = new Set(this.selection.points ?? []);
    const { marks } = this.content;
    const rank = (k) => (picked.has(k) ? 0 : this.suspected.has(k) ? 1 : marks[k] & (KNOWN | UNDETERMINED) ? 2 : marks[k] & (STATION | CAMERA) ? 3 : 4);
    const room = new Room(this.isCrowded ? 2 : 0.5);
    for (const [, x, y] of this.inside) room.fill(x - 5, y - 5, 10, 10);
    room.fill(0, 0, 46, 62);
    room.fill(0, this.height - BARS, this.width, BARS);
    this.nameRays(sheet, room);
    let count = 0;
    const ranked = Array.from({ length: this.isCrowded ? 4 : 5 }, () => []);
    for (const one of this.inside) ranked[rank(one[0])]?.push(one);
    for (const [k, x, y] of ranked.flat()) {
      if (count >= MOST_NAMES) break;
      if (!PLACES_OF_NAMES.some(([dx, dy, back]) => room.isFree(x + dx - back * LEAST_NAME - 1, y + dy - 10, LEAST_NAME, 12))) continue;
      const weight = rank(k) < 2 ? 600 : 400;
      const wide = sheet.wide(this.names[k], 12, weight);
      const free = PLACES_OF_NAMES.find(([dx, dy, back]) => this.holds(x + dx - back * wide, y + dy, wide) && room.take(x + dx - back * wide - 1, y + dy - 10, wide + 2, 12));
      if (!free) continue;
      const style = picked.has(k) ? colour("sel") : this.suspected.has(k) ? colour("bad") : colour("tx");
      sheet.text(this.names[k], x + free[0] - free[2] * wide, y + free[1], { style, weight, halo: colour("halo") });
      count += 1;
    }
  }

  holds(x, y, wide) {
    return x > 2 && y > 14 && x + wide < this.width - 2 && y < this.height - 2;
  }

  /** North, and a bar for the ground and one for each thing that is enlarged. */
  drawBars(sheet) {
    const [ink, path] = [colour("tx"), sheet.path()];
    if (!this.content.scheme) {
      sheet.text(this.content.axes?.[1] ?? "y", 20, 16, { style: ink, weight: 600, anchor: "center" });
      arrow(path, 20, 50, 20, 20);
    }
    sheet.stroke(path, ink, 1.6);
    const ground = sheet.path();
    ground.rect(0, this.height - BARS, this.width, BARS);
    sheet.fill(ground, colour("sf"), 0.9);
    let x = 14;
    for (const [length, scale, style, text] of this.bars()) {
      const [wide, y, bar] = [length * scale, this.height - 10, sheet.path()];
      bar.moveTo(x, y - 5);
      bar.lineTo(x, y);
      bar.lineTo(x + wide, y);
      bar.lineTo(x + wide, y - 5);
      sheet.stroke(bar, style, 2);
      sheet.text(text, x + wide + 6, y, { style, size: 11.5 });
      x += wide + 24 + sheet.wide(text, 11.5, 400);
    }
  }

  bars() {
    const bar = (of, pixels, scale, style, words) => {
      const unit = quantity(of);
      const rounded = roundBelow(pixels / scale * unit.factor);
      return [rounded / unit.factor, scale, style, `${significant(rounded)} ${unit.unit} ${words}`.trim()];
    };
    const found = this.content.scheme ? [] : [bar("length", 90, this.scale, colour("tx"), "")];
    const isSeen = this.layers.ellipses && this.usual > 0;
    const hasMoved = this.layers.moved && this.content.moved;
    if (isSeen || hasMoved) found.push(bar("small_length", 70, this.ellipseScale, hasMoved ? colour("vec") : colour("ell"), [isSeen ? "ellipses" : "", hasMoved ? this.content.displaced ?? "displacements" : ""].filter(Boolean).join(", ")));
    if (this.layers.residuals && this.longest > 0) found.push(bar("small_length", 70, this.residualScale, colour("res"), "residuals"));
    return found;
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => this.wheeled(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.pressed(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.released(event));
    canvas.addEventListener("pointerleave", () => this.hover(null));
    canvas.addEventListener("keydown", (event) => this.typed(event));
    new ResizeObserver(() => {
      if (canvas.clientWidth === this.width && canvas.clientHeight === this.height) return;
      const isFirst = !this.width;
      const wasWhole = this.scale === this.whole;
      this.resize();
      if (isFirst || wasWhole) this.fit();
      else this.redraw();
    }).observe(canvas);
  }

  /** The wheel enlarges a plan that has the focus: a page that scrolls past it is not held up. */
  wheeled(event) {
    if (document.activeElement !== this.canvas && !event.ctrlKey && !event.metaKey) {
      this.hint?.();
      return;
    }
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
  }

  /** Enlarges about a place of the canvas. */
  zoom(factor, x = this.width / 2, y = (this.height - BARS + 14) / 2) {
    const [east, north] = this.at(x, y);
    this.scale *= factor;
    const [nowEast, nowNorth] = this.at(x, y);
    this.middle = [this.middle[0] + east - nowEast, this.middle[1] + north - nowNorth];
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
    const now = [event.offsetX, event.offsetY];
    const before = this.pointers.get(event.pointerId);
    if (!before) {
      this.hover(now);
      return;
    }
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

  hover(place) {
    const found = place ? this.near(...place) : {};
    if (found.point !== this.hovered) {
      this.hovered = found.point;
      this.redraw();
    }
    this.told?.(found, place);
  }

  typed(event) {
    const steps = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] };
    if (steps[event.key]) this.move(...steps[event.key]);
    else if (event.key === "+" || event.key === "=") this.zoom(1.5);
    else if (event.key === "-") this.zoom(1 / 1.5);
    else if (event.key === "0") this.fit();
    else if (event.key === "n") this.step(1);
    else if (event.key === "p") this.step(-1);
    else if (event.key === "Enter") this.zoomTo();
    else return;
    event.preventDefault();
  }

  /** Selects the next point, or the one before. */
  step(by) {
    const now = this.drawn.indexOf(this.selection.points?.[0] ?? -1);
    const next = now < 0 ? 0 : (now + by + this.drawn.length) % this.drawn.length;
    this.choose({ point: this.drawn[next] }, "plan");
  }

  /** The point at a place, or else the sight; empty for neither. */
  near(x, y) {
    const point = nearest(this.inside, ([, px, py]) => Math.hypot(px - x, py - y));
    if (point) return { point: point[0] };
    if (!this.layers.sights || this.isCut) return {};
    const lines = this.sights.list.filter((pair) => this.placed[pair.a] && this.placed[pair.b] && pair.types.some((type) => this.visible.has(type)));
    const found = nearest(lines, (pair) => fromLine(this.placed[pair.a], this.placed[pair.b], x, y), NEAR / 2);
    return found ? { row: this.sights.rowOf(found) } : {};
  }

  pick(x, y) {
    this.choose(this.near(x, y), "plan");
  }

  /** Shows the points of a selection; moves the plan where they would not be seen. */
  follow(points) {
    const known = points.filter((point) => this.content.x[point] !== null && this.content.x[point] !== undefined);
    this.selection = { points: known };
    if (known.length && !known.every((point) => this.isInside(...this.place(point)))) this.middle = this.centre(known);
    this.redraw();
  }

  centre(points) {
    return ["x", "y"].map((axis) => points.reduce((sum, k) => sum + this.content[axis][k], 0) / points.length);
  }

  /** Enlarges what is selected. */
  zoomTo() {
    const points = this.selection.points ?? [];
    if (!points.length) return;
    const [wide, tall] = ["x", "y"].map((axis) => {
      const [low, top] = extent(points, this.content[axis]);
      return top - low;
    });
    this.middle = this.centre(points);
    const whole = this.whole;
    this.scale = points.length > 1 ? Math.min(5 * whole, 0.55 * Math.min(this.width / Math.max(wide, 1e-9), this.height / Math.max(tall, 1e-9))) : 2.4 * whole;
    this.redraw();
  }

  isInside(x, y) {
    return x > 0 && y > 0 && x < this.width && y < this.height - BARS;
  }
}
