// Lines between points: the observations that join them, drawn as one line or as one of each type.

const columnOf = (table, key) => table?.columns.find((column) => column.key === key);

/** Which observations join each pair of points. */
class Sights {
  /**
   * @param table Observations, with columns type, from and to; undefined where there are none.
   * @param suspected Rows that are drawn apart.
   */
  constructor(table, suspected, { across = [], along = [] } = {}) {
    const [type, from, to] = ["type", "from", "to"].map((key) => columnOf(table, key));
    this.types = type ? type.choices : [];
    this.typeOf = type?.values ?? [];
    this.measures = { redundancy: columnOf(table, "redundancy"), w: columnOf(table, "w") };
    this.residual = columnOf(table, "residual");
    this.aside = new Set(across.map((name) => this.types.indexOf(name)));
    this.ahead = new Set(along.map((name) => this.types.indexOf(name)));
    this.pairs = new Map();
    for (let row = 0; row < (from?.values.length ?? 0); row += 1) this.add(row, this.typeOf[row] ?? 0, from.values[row], to.values[row], table.unused?.[row]);
    this.list = [...this.pairs.values()];
    for (const pair of this.list) pair.isHot = pair.rows.some((row) => suspected.has(row));
  }

  add(row, type, from, to, unused) {
    if (from === null || to === null || from === to) return;
    const [a, b] = from < to ? [from, to] : [to, from];
    const key = a * 1e6 + b;
    let pair = this.pairs.get(key);
    if (!pair) this.pairs.set(key, (pair = { a, b, types: [], rows: [], used: false, isForward: [] }));
    if (!pair.types.includes(type)) pair.types.push(type);
    pair.rows.push(row);
    pair.isForward.push(from === a);
    pair.used ||= !unused;
  }

  /** The worst of a pair: the smallest redundancy or the largest w, its size; null without any. */
  worst(pair, name, isVisible) {
    const column = this.measures[name];
    let found = null;
    for (const row of pair.rows) {
      const value = column?.values[row];
      if (value === null || value === undefined || !isVisible.has(this.typeOf[row] ?? 0)) continue;
      const size = Math.abs(value);
      if (found === null || (name === "redundancy" ? size < found : size > found)) found = size;
    }
    return found;
  }

  /** The row of a pair that a click means: that of the largest w. */
  rowOf(pair) {
    const size = (row) => Math.abs(this.measures.w?.values[row] ?? 0);
    return pair.rows.reduce((best, row) => (size(row) > size(best) ? row : best));
  }

  /** Residuals of a pair in the plane (m): those of directions across the sight, of distances along it. */
  shift(pair, x, y) {
    const [dx, dy] = [x[pair.b] - x[pair.a], y[pair.b] - y[pair.a]];
    const length = Math.hypot(dx, dy) || 1;
    let [east, north] = HERE;
    pair.rows.forEach((row, k) => {
      const [value, sign] = [this.residual?.values[row] ?? 0, pair.isForward[k] ? 1 : -1];
      if (this.aside.has(this.typeOf[row])) [east, north] = [east + sign * value * dy, north - sign * value * dx];
      if (this.ahead.has(this.typeOf[row])) [east, north] = [east + sign * value * dx / length, north + sign * value * dy / length];
    });
    return [east, north];
  }
}
