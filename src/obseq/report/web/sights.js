// Lines of sight: the observations between two points, drawn as one line or as one of each type.

const columnOf = (table, key) => table?.columns.find((column) => column.key === key);

/** Which observations join each pair of points. */
class Sights {
  constructor(table) {
    const [type, from, to] = ["type", "from", "to"].map((key) => columnOf(table, key));
    this.types = type ? type.choices : [];
    this.pairs = new Map();
    for (let row = 0; row < (from?.values.length ?? 0); row += 1) this.add(row, type.values[row], from.values[row], to.values[row], table.unused?.[row]);
    this.list = [...this.pairs.values()];
    this.measures = { redundancy: columnOf(table, "redundancy"), standardised: columnOf(table, "standardised") };
  }

  add(row, type, from, to, unused) {
    if (from === null || to === null || from === to) return;
    const [a, b] = from < to ? [from, to] : [to, from];
    const key = a * 1e6 + b;
    let pair = this.pairs.get(key);
    if (!pair) this.pairs.set(key, (pair = { a, b, types: [], rows: [], used: false }));
    if (!pair.types.includes(type)) pair.types.push(type);
    pair.rows.push(row);
    pair.used ||= !unused;
  }

  /** The worst of a pair: the smallest redundancy or the largest standardised residual; null without any. */
  worst(pair, name, isVisible, typeOf) {
    const column = this.measures[name];
    let found = null;
    for (const row of pair.rows) {
      const value = column?.values[row];
      if (value === null || value === undefined || !isVisible.has(typeOf[row])) continue;
      const size = Math.abs(value);
      if (found === null || (name === "redundancy" ? size < found : size > found)) found = size;
    }
    return found;
  }
}
