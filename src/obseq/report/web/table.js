// A table that is sorted, filtered and linked with the plan; only the rows in sight are elements of the page.

const BESIDE = 8;
const MOST_PRINTED = 3000;
const SAMPLE = 400;
const TALLEST = 480;

class Table {
  static rowHeight = 26.4;

  constructor(content, names, select) {
    Object.assign(this, { content, names, select, columns: content.columns });
    this.size = this.columns.length ? this.columns[0].values.length : 0;
    this.filters = this.columns.map(() => null);
    this.order = content.sort ? { column: content.sort[0], sign: content.sort[1] } : null;
    this.point = null;
    this.picked = -1;
    this.build();
    this.refresh();
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

  /** The number of each row that filters of a column compare: in the unit shown. */
  numbers(column) {
    const [straight, angular] = [false, true].map((isAngular) => scaleOf(column, isAngular).factor);
    return (row) => {
      const value = column.values[row];
      return value === null ? NaN : value * (this.isAngular(row) ? angular : straight);
    };
  }

  build() {
    const { id, title, about } = this.content;
    this.element = make("section", { id, "aria-labelledby": `${id}-title` });
    this.body = make("tbody");
    this.head = make("thead", {}, [this.titles(), this.filterRow()]);
    this.widths = make("colgroup");
    this.table = make("table", { "aria-labelledby": `${id}-title` }, [this.widths, this.head, this.body]);
    this.scroll = make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": `rows of ${title}` }, [this.table]);
    this.count = make("span", { role: "status" });
    this.chip = make("button", { type: "button", class: "chip", hidden: "" });
    this.chip.addEventListener("click", () => this.select({}));
    this.scroll.addEventListener("scroll", () => this.draw());
    this.body.addEventListener("click", (event) => this.clicked(event.target.closest("tr")));
    this.body.addEventListener("keydown", (event) => this.pressed(event));
    this.element.append(make("h2", { id: `${id}-title` }, [title]), ...(about ? [make("p", { class: "about" }, [about])] : []),
      make("div", { class: "tools" }, [this.count, this.chip]), this.scroll);
  }

  titles() {
    this.heads = this.columns.map((column, k) => {
      const button = make("button", { type: "button" });
      button.addEventListener("click", () => this.sortBy(k));
      return make("th", { scope: "col", ...(isText(column) ? { class: "name" } : {}), ...(column.about ? { title: column.about } : {}) }, [button]);
    });
    return make("tr", {}, this.heads);
  }

  filterRow() {
    const cells = this.columns.map((column, k) => {
      const input = column.quantity === "choice" && column.choices.length <= 30 ? this.choiceFilter(column) : this.textFilter(column);
      input.addEventListener("input", () => this.setFilter(k, input));
      return make("td", {}, [input]);
    });
    return make("tr", { class: "filters" }, cells);
  }

  choiceFilter(column) {
    const options = ["", ...column.choices].map((text) => make("option", { value: text }, [text || "all"]));
    return make("select", { "aria-label": `filter ${this.content.title}: ${column.title}` }, options);
  }

  textFilter(column) {
    const hint = isText(column) ? "part of the text" : "> 3, < 0.5, 1..2, or between bars for the size: |> 3|";
    return make("input", { type: "text", title: hint, placeholder: isText(column) ? "" : ">", "aria-label": `filter ${this.content.title}: ${column.title} (${hint})` });
  }

  setFilter(k, input) {
    const [column, text] = [this.columns[k], input.value.trim()];
    const wish = text.toLowerCase();
    if (!text) this.filters[k] = null;
    else if (input.tagName === "SELECT") this.filters[k] = () => {
      const wanted = column.choices.indexOf(text);
      return (row) => column.values[row] === wanted;
    };
    else if (isText(column)) this.filters[k] = () => (row) => this.text(column, row).toLowerCase().includes(wish);
    else {
      const keeps = numberFilter(text);
      input.toggleAttribute("aria-invalid", keeps === null);
      this.filters[k] = keeps && (() => {
        const number = this.numbers(column);
        return (row) => keeps(number(row));
      });
    }
    this.scroll.scrollTop = 0;
    this.refresh();
  }

  sortBy(k) {
    const first = this.columns[k].by_size ? -1 : 1;
    if (this.order?.column !== k) this.order = { column: k, sign: first };
    else this.order = this.order.sign === first ? { column: k, sign: -first } : null;
    this.refresh();
  }

  /** The rows that are shown, in their order. */
  refresh() {
    const tests = this.filters.filter(Boolean).map((filter) => filter());
    if (this.point !== null) tests.unshift(this.ofPoint(this.point));
    const rows = [];
    for (let row = 0; row < this.size; row += 1) {
      if (tests.every((test) => test(row))) rows.push(row);
    }
    this.rows = this.order ? this.sorted(rows) : rows;
    this.describe();
    this.draw(true);
  }

  sorted(rows) {
    const { column: k, sign } = this.order;
    const column = this.columns[k];
    if (isText(column)) {
      const texts = new Map(rows.map((row) => [row, this.text(column, row)]));
      const collator = new Intl.Collator(undefined, { numeric: true });
      return rows.sort((a, b) => sign * collator.compare(texts.get(a), texts.get(b)) || a - b);
    }
    const key = new Float64Array(this.size);
    for (const row of rows) {
      const value = column.values[row];
      key[row] = value === null ? NaN : column.by_size ? Math.abs(value) : value;
    }
    const numbers = rows.filter((row) => !Number.isNaN(key[row])).sort((a, b) => sign * (key[a] - key[b]) || a - b);
    return numbers.concat(rows.filter((row) => Number.isNaN(key[row])));
  }

  /** Whether a row names a point. */
  ofPoint(point) {
    const columns = this.columns.filter((column) => column.quantity === "point");
    return (row) => columns.some((column) => column.values[row] === point);
  }

  get hasPoints() {
    return this.columns.some((column) => column.quantity === "point");
  }

  describe() {
    this.columns.forEach((column, k) => {
      const unit = titleUnit(column);
      const title = unit ? `${column.title} (${unit})` : column.title;
      this.heads[k].firstChild.textContent = title;
      this.heads[k].dataset.title = title; // what paper repeats on each sheet: it takes no buttons
      const sign = this.order?.column === k ? this.order.sign : 0;
      this.heads[k].setAttribute("aria-sort", sign ? (sign > 0 ? "ascending" : "descending") : "none");
    });
    const all = this.rows.length === this.size;
    this.count.textContent = all ? `${this.size} rows` : `${this.rows.length} of ${this.size} rows`;
    this.chip.hidden = this.point === null;
    this.chip.textContent = this.point === null ? "" : `point ${this.names[this.point]} ✕ show all`;
    this.measure();
    this.table.setAttribute("aria-rowcount", String(this.rows.length + 2));
  }

  /** Gives columns their widths; they stay while units and language do, whatever is filtered or sorted. */
  measure() {
    const shownIn = Object.values(settings).join(" ");
    if (this.shownIn !== shownIn) this.widths.replaceChildren(...this.measured());
    this.shownIn = shownIn;
  }

  /** Widths of columns from their longest texts: those of a sample of the rows. */
  measured() {
    const step = Math.max(1, Math.floor(this.size / SAMPLE));
    let total = 0;
    const elements = this.columns.map((column, k) => {
      let longest = Math.min(14, Math.max(...this.heads[k].textContent.split(" ").map((word) => word.length)) + 2);
      for (let row = 0; row < this.size; row += step) longest = Math.max(longest, String(this.text(column, row)).length);
      const width = Math.max(5, Math.min(longest, column.quantity === "text" ? 70 : 30)) + 2.5;
      total += width;
      return make("col", { style: `width:${width}ch` });
    });
    this.table.style.width = `${total}ch`;
    return elements;
  }

  draw(force = false) {
    if (!this.element.isConnected) return;
    const height = Table.rowHeight;
    const seen = Math.ceil(((this.last && this.scroll.clientHeight) || TALLEST) / height);
    const first = Math.max(0, Math.min(Math.floor(this.scroll.scrollTop / height), this.rows.length - seen) - BESIDE);
    const last = Math.min(this.rows.length, first + seen + 2 * BESIDE);
    if (!force && first === this.first && last === this.last) return;
    Object.assign(this, { first, last });
    this.show(first, last, height);
  }

  /** Takes the height of all rows from one that is drawn: asking for each table would lay the page out each time. */
  measureRow() {
    Table.rowHeight = this.body.querySelector("tr[data-row]")?.getBoundingClientRect().height || Table.rowHeight;
  }

  show(first, last, height) {
    const rows = this.rows.slice(first, last).map((row, k) => this.row(row, first + k));
    const space = (count) => count > 0 ? [make("tr", { class: "space", "aria-hidden": "true" }, [make("td", { colspan: this.columns.length, style: `height:${count * height}px` })])] : [];
    this.body.replaceChildren(...space(first), ...rows, ...space(this.rows.length - last));
  }

  row(row, place) {
    const cells = this.columns.map((column) => this.cell(column, row));
    const unused = this.content.unused?.[row] ? { class: "unused" } : {};
    return make("tr", { "data-row": row, "aria-rowindex": place + 3, tabindex: this.hasPoints ? "0" : "-1", "aria-selected": String(row === this.picked), ...unused }, cells);
  }

  cell(column, row) {
    const text = String(this.text(column, row));
    const alarm = column.limit !== undefined && Math.abs(column.values[row] ?? 0) > column.limit;
    const style = [isText(column) ? "name" : "", alarm ? "alarm" : ""].join(" ").trim();
    return make("td", { ...(style ? { class: style } : {}), ...(text.length > 24 ? { title: text } : {}) }, [text]);
  }

  clicked(element) {
    if (!element?.dataset.row || !this.hasPoints) return;
    const row = Number(element.dataset.row);
    const points = this.columns.filter((column) => column.quantity === "point").map((column) => column.values[row]);
    this.select({ table: this.content.id, row, points: points.filter((point) => point !== null) });
  }

  pressed(event) {
    const element = event.target.closest("tr[data-row]");
    if (event.key === "Enter") this.clicked(element);
    const next = { ArrowDown: element?.nextElementSibling, ArrowUp: element?.previousElementSibling }[event.key];
    if (next?.dataset.row) {
      next.focus();
      event.preventDefault();
    }
  }

  /** Follows a selection made here or elsewhere. */
  follow(selection) {
    this.picked = selection.table === this.content.id ? selection.row : this.rowOf(selection);
    const point = selection.only && this.hasPoints ? selection.only.point : null;
    if (point !== this.point) {
      this.point = point;
      this.scroll.scrollTop = 0;
      this.refresh();
    } else this.draw(true);
    if (selection.table !== this.content.id) this.bring();
  }

  rowOf(selection) {
    return selection.table === undefined && selection.row !== undefined && this.content.id === "observations" ? selection.row : -1;
  }

  /** Scrolls to the selected row. */
  bring() {
    const place = this.picked < 0 ? -1 : this.rows.indexOf(this.picked);
    if (place >= 0) this.scroll.scrollTop = Math.max(0, place - 3) * Table.rowHeight;
  }

  /** All rows for paper, at most so many; `draw` takes them away again. */
  print() {
    this.show(0, Math.min(this.rows.length, MOST_PRINTED), 0);
    const hidden = this.rows.length - MOST_PRINTED;
    this.count.textContent = hidden > 0 ? `${hidden} more rows are in the listing` : "";
  }
}
