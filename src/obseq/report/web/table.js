// A table that is sorted, filtered and linked with the plan; only the rows in sight are elements of the page.

const BESIDE = 8;
const SAMPLE = 400;
const TALLEST = 470;
const BESIDE_TEXT = 22;
const SIZES = new Set(["redundancy"]);

class Table {
  static rowHeight = 28;

  constructor(content, names, choose) {
    Object.assign(this, { content, names, choose, hasAll: false, filter: "", picked: new Set(), size: content.size });
    this.order = content.order ? { key: content.order, sign: -1 } : null;
    this.element = make("div");
    this.build();
  }

  get columns() {
    return this.content.columns.filter((column) => this.hasAll || !column.rare);
  }

  text(column, row) {
    const value = column.values[row];
    if (column.quantity === "text") return value ?? ABSENT;
    if (column.quantity === "choice") return value === null ? ABSENT : column.choices[value];
    if (column.quantity === "point") return value === null ? ABSENT : this.names[value];
    return shown(column, value, this.isAngular(row));
  }

  isAngular(row) {
    return Boolean(this.content.angular?.[row]);
  }

  /** The number of a row that a filter compares: in the unit shown. */
  number(column, row) {
    const value = column.values[row];
    return value === null ? NaN : value * scaleOf(column, this.isAngular(row)).factor;
  }

  build() {
    const { title, about, hint, chips = [] } = this.content;
    this.input = make("input", { type: "search", placeholder: `Filter: ${hint ?? "text"}`, "aria-label": `filter ${title}: words, or comparisons such as |w|>3` });
    this.input.value = this.filter;
    this.input.addEventListener("input", () => this.setFilter(this.input.value, true));
    this.chips = chips.map(([text, filter]) => button(`${text} `, () => this.setFilter(this.filter === filter ? "" : filter), { "data-filter": filter, "aria-pressed": "false" }));
    this.chips.forEach((chip) => chip.append(make("span", { class: "count" }, [String(this.rowsOf(chip.dataset.filter).length)])));
    const all = this.content.columns.some((column) => column.rare) ? [button("All columns", () => this.toggle(), { "aria-pressed": String(this.hasAll) })] : [];
    this.count = make("span", { class: "count", role: "status" });
    [this.head, this.body, this.widths] = [make("thead"), make("tbody"), make("colgroup")];
    this.grid = make("table", {}, [make("caption", { class: "hidden" }, [title]), this.widths, this.head, this.body]);
    this.scroll = make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": `rows of ${title}` }, [this.grid]);
    this.scroll.addEventListener("scroll", () => this.draw());
    this.body.addEventListener("click", (event) => this.clicked(event.target.closest("tr")));
    this.scroll.addEventListener("keydown", (event) => this.pressed(event));
    const bar = make("div", { class: "bar" }, [this.input, ...this.chips, ...all, button("CSV", () => save(`${this.content.id}.csv`, this.csv(), "text/csv")), this.count]);
    this.element.replaceChildren(bar, ...(about ? [make("p", { class: "note" }, [rich(about)])] : []), this.scroll);
    this.describe();
    this.refresh();
  }

  toggle() {
    this.hasAll = !this.hasAll;
    this.build();
  }

  /** Shows the rows that a filter keeps. */
  setFilter(text, isTyped = false) {
    this.filter = text;
    if (!isTyped) this.input.value = text;
    this.chips.forEach((chip) => chip.setAttribute("aria-pressed", String(chip.dataset.filter === text)));
    this.scroll.scrollTop = 0;
    this.refresh();
  }

  /** The rows that pass all of the words and comparisons of a filter. */
  rowsOf(filter) {
    const tests = filter.trim().split(/\s+/).filter(Boolean).map((word) => this.test(word));
    const rows = [];
    for (let row = 0; row < this.size; row += 1) if (tests.every((test) => test(row))) rows.push(row);
    return rows;
  }

  test(word) {
    const found = word.match(/^\|?([^|<>=]+)\|?(<=|>=|<|>|=)(-?[\d.,]+)$/);
    const key = found && found[1].replaceAll("_", " ").toLowerCase();
    const column = found && this.content.columns.find((item) => item.key.toLowerCase() === key || item.title.toLowerCase() === key);
    if (column && !isText(column)) {
      const bound = Number(found[3].replace(",", "."));
      const size = word.startsWith("|") ? Math.abs : (value) => value;
      const compare = { "<": (v) => v < bound, ">": (v) => v > bound, "<=": (v) => v <= bound, ">=": (v) => v >= bound, "=": (v) => v === bound }[found[2]];
      return (row) => compare(size(this.number(column, row)));
    }
    const wish = word.toLowerCase();
    const texts = this.content.columns.filter(isText);
    const point = this.names.findIndex((name) => name.toLowerCase() === wish);
    if (point >= 0) {
      const ends = texts.filter((item) => item.quantity === "point");
      if (ends.length) return (row) => ends.some((item) => item.values[row] === point);
    }
    return (row) => texts.some((item) => String(this.text(item, row)).toLowerCase().includes(wish));
  }

  sortBy(column) {
    const first = column.by_size ? -1 : 1;
    if (this.order?.key !== column.key) this.order = { key: column.key, sign: first };
    else this.order = this.order.sign === first ? { key: column.key, sign: -first } : null;
    this.describe();
    this.refresh();
  }

  refresh() {
    this.rows = this.sorted(this.rowsOf(this.filter));
    this.count.textContent = this.rows.length === this.size ? `${this.size} ${this.size === 1 ? "row" : "rows"}` : `${this.rows.length} of ${this.size} rows`;
    this.grid.setAttribute("aria-rowcount", String(this.rows.length + 1));
    this.draw(true);
  }

  sorted(rows) {
    const column = this.order && this.content.columns.find((item) => item.key === this.order.key);
    if (!column) return rows;
    const { sign } = this.order;
    if (isText(column)) {
      const texts = new Map(rows.map((row) => [row, String(this.text(column, row))]));
      const collator = new Intl.Collator(undefined, { numeric: true });
      return rows.sort((a, b) => sign * collator.compare(texts.get(a), texts.get(b)) || a - b);
    }
    const key = new Float64Array(this.size);
    const off = (row) => this.content.unused?.[row] ?? 0;
    for (const row of rows) {
      const value = column.values[row];
      key[row] = value === null ? NaN : column.by_size ? Math.abs(value) : value;
    }
    const numbers = rows.filter((row) => !Number.isNaN(key[row])).sort((a, b) => off(a) - off(b) || sign * (key[a] - key[b]) || a - b);
    return numbers.concat(rows.filter((row) => Number.isNaN(key[row])));
  }

  /** Titles with their units, and widths of the columns. */
  describe() {
    const cells = this.columns.map((column) => {
      const unit = titleUnit(column);
      const sign = this.order?.key === column.key ? this.order.sign : 0;
      const title = make("button", { type: "button", ...(column.about ? { title: column.about } : {}) }, [column.title, sign ? (sign > 0 ? " ▴" : " ▾") : "", ...(unit ? [make("small", {}, [unit])] : [])]);
      title.addEventListener("click", () => this.sortBy(column));
      return make("th", { scope: "col", "aria-sort": sign ? (sign > 0 ? "ascending" : "descending") : "none", ...(isText(column) ? { class: "t" } : {}) }, [title]);
    });
    this.head.replaceChildren(make("tr", {}, cells));
    let total = 0;
    const step = Math.max(1, Math.floor(this.size / SAMPLE));
    const widths = this.columns.map((column) => {
      const title = Math.min(14, Math.max(...`${column.title}  `.split(" ").map((word) => word.length)) + 2);
      let longest = 0;
      for (let row = 0; row < this.size; row += step) longest = Math.max(longest, String(this.text(column, row)).length);
      const width = Math.max(5, title, Math.min(longest, column.quantity === "text" ? 70 : 30) + (column.bar ? 7 : 0));
      total += width;
      return make("col", { style: `width:calc(${width}ch + ${BESIDE_TEXT}px)` });
    });
    this.widths.replaceChildren(...widths);
    this.grid.style.minWidth = `calc(${total}ch + ${widths.length * BESIDE_TEXT}px)`;
  }

  draw(force = false) {
    const height = Table.rowHeight;
    const seen = Math.ceil((this.scroll.clientHeight || TALLEST) / height);
    const first = Math.max(0, Math.min(Math.floor(this.scroll.scrollTop / height), this.rows.length - seen) - BESIDE);
    const last = Math.min(this.rows.length, first + seen + 2 * BESIDE);
    if (!force && first === this.first && last === this.last) return;
    Object.assign(this, { first, last });
    const rows = this.rows.slice(first, last).map((row, k) => this.row(row, first + k));
    const space = (count) => count > 0 ? [make("tr", { class: "space", "aria-hidden": "true" }, [make("td", { colspan: this.columns.length, style: `height:${count * height}px` })])] : [];
    this.body.replaceChildren(...space(first), ...rows, ...space(this.rows.length - last));
  }

  row(row, place) {
    const style = [this.content.unused?.[row] ? "off" : "", this.content.suspected?.includes(row) ? "hot" : ""].join(" ").trim();
    return make("tr", { "data-row": row, "aria-rowindex": place + 2, "aria-selected": String(this.picked.has(row)), ...(style ? { class: style } : {}) }, this.columns.map((column) => this.cell(column, row)));
  }

  cell(column, row) {
    const text = String(this.text(column, row));
    const value = column.values[row];
    const alarm = column.limit !== undefined && Math.abs(value ?? 0) > column.limit;
    const style = [isText(column) ? "t" : "", alarm ? "alarm" : ""].join(" ").trim();
    const drawn = column.bar && value !== null ? [bar(column.bar, value, column.limit ?? this.content.limit ?? 3.29)] : [];
    return make("td", { ...(style ? { class: style } : {}), ...(text.length > 24 ? { title: text } : {}) }, [text, ...drawn]);
  }

  get isLinked() {
    return Boolean(this.content.rows) || this.content.columns.some((column) => column.quantity === "point");
  }

  /** What a row stands for: an observation, or the first point that it names. */
  selectionOf(row) {
    if (this.content.rows && this.content.rows !== "point") return { table: this.content.id, row };
    const column = this.content.columns.find((item) => item.quantity === "point" && item.values[row] !== null);
    return column ? { point: column.values[row] } : {};
  }

  clicked(element) {
    if (element?.dataset.row && this.isLinked) this.choose(this.selectionOf(Number(element.dataset.row)), this.content.id);
  }

  pressed(event) {
    const by = { ArrowDown: 1, ArrowUp: -1, PageDown: 12, PageUp: -12 }[event.key];
    if (!by || !this.rows.length || !this.isLinked) return;
    const now = this.rows.findIndex((row) => this.picked.has(row));
    const next = Math.max(0, Math.min(this.rows.length - 1, now < 0 ? 0 : now + by));
    this.choose(this.selectionOf(this.rows[next]), this.content.id);
    this.bring();
    event.preventDefault();
  }

  /** Follows a selection made here or elsewhere. */
  follow(selection, isOwn) {
    this.picked = new Set();
    if (selection.table === this.content.id) this.picked.add(selection.row);
    else if (selection.point !== undefined && this.content.rows === "point") this.picked.add(this.content.columns.find((item) => item.quantity === "point").values.indexOf(selection.point));
    this.draw(true);
    if (!isOwn) this.bring();
  }

  /** Scrolls to the selected row. */
  bring() {
    const place = this.picked.size ? this.rows.findIndex((row) => this.picked.has(row)) : -1;
    const height = Table.rowHeight;
    const [top, room] = [this.scroll.scrollTop, this.scroll.clientHeight - 2 * height];
    if (place >= 0 && (place * height < top || place * height > top + room)) this.scroll.scrollTop = Math.max(0, place - 3) * height;
    this.draw(true);
  }

  /** The rows that are shown, all columns, as text of a file; a column of units where rows differ. */
  csv() {
    const isFormula = (text) => /^['\s]*[=+@-]/.test(text) && Number.isNaN(Number(text));
    const safe = (text) => (isFormula(text) ? `'${text}` : text);
    const quoted = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const told = new Set();
    const columns = this.content.columns.flatMap((column) => {
      const [unit, mixed] = [titleUnit(column), MIXED[column.quantity]];
      const number = (row) => String(this.text(column, row)).replace(mixed ? / .*/ : "", "");
      const made = [[unit ? `${column.title} (${unit})` : column.title, (row) => (column.values[row] === null ? "" : number(row))]];
      if (mixed && !told.has(column.quantity)) made.push([`unit of ${column.title}`, (row) => scaleOf(column, this.isAngular(row)).unit]);
      told.add(column.quantity);
      return made;
    });
    const line = (texts) => texts.map((text) => quoted(safe(text))).join(",");
    return `${[line(columns.map(([title]) => title)), ...this.rows.map((row) => line(columns.map(([, text]) => text(row))))].join("\n")}\n`;
  }
}

/** A value beside its number: w to both sides, a redundancy from nothing to all. */
function bar(kind, value, limit) {
  if (SIZES.has(kind)) {
    const style = value < 0.1 ? "bad" : value < 0.3 ? "weak" : "ok";
    return svg("svg", { class: "inline", width: 36, height: 10, "aria-hidden": "true" }, [svg("rect", { y: 2, width: 36, height: 6, class: "rail" }), svg("rect", { y: 2, width: Math.max(0.6, 36 * Math.min(1, value)), height: 6, class: `fill ${style}` })]);
  }
  const wide = Math.max(0.6, Math.min(1, Math.abs(value) / limit) * 21);
  return svg("svg", { class: "inline", width: 46, height: 10, "aria-hidden": "true" }, [svg("path", { d: "M23 0v10", class: "axis" }), svg("rect", { x: value < 0 ? 23 - wide : 23, y: 2, width: wide, height: 6, class: Math.abs(value) > limit ? "fill bad" : "fill plain" })]);
}
