// The page: verdict, cards, findings, plan, tables and sections, linked by one selection.

const MOST_SELECTED = 12;

class Page {
  constructor(content) {
    this.content = content;
    this.selection = {};
    Object.assign(settings, { lengths: memory.get("lengths") ?? content.units.length, angles: memory.get("angles") ?? content.units.angle, language: memory.get("language") ?? "en" });
    for (const list of content.lists) for (const item of list.items) this.mark(item);
    this.tables = new Map(content.tables.map((table) => [table.id, new Table(table, content.names, (...chosen) => this.choose(...chosen))]));
    this.observations = content.tables.find((table) => table.rows && table.rows !== "point");
    byId("title").append(content.title, make("small", {}, [content.about]));
    this.system = window.matchMedia("(prefers-color-scheme: dark)");
    this.paint(memory.get("theme"));
    this.showTabs();
    this.showHead();
    if (content.plan) this.showPlan();
    else byId("work").classList.add("alone");
    this.fillSections();
    this.listen();
    this.start();
  }

  /** Suspected rows and points are drawn apart. */
  mark({ level, to }) {
    if (level !== "bad" || !to) return;
    const table = this.content.tables.find((item) => item.id === to.table);
    if (table && to.row !== undefined) (table.suspected ??= []).push(to.row);
    if (to.point !== undefined && this.content.plan) (this.content.plan.suspected ??= []).push(to.point);
  }

  verdict() {
    const { level, text, detail } = this.content.verdict;
    return [make("div", { class: `verdict ${level}`, role: "status" }, [icon(level), make("div", {}, [make("p", { class: "v" }, [rich(text)]), make("p", { class: "d" }, [rich(detail)])])])];
  }

  showHead() {
    byId("verdict").replaceChildren(...this.verdict());
    byId("cards").replaceChildren(...this.content.cards.map((item) => card(item, (to) => this.go(to))));
    byId("list").replaceChildren(...this.content.lists.flatMap((list) => [make("h2", {}, [`${list.title} `, make("span", { class: "count" }, [String(list.items.length)])]), ...list.items.flatMap((item) => this.finding(item))]));
    this.showSelection();
  }

  finding(item) {
    const lines = [
      make("span", { class: "h" }, [icon(item.level, 13), make("span", {}, [rich(item.title)]), make("span", { class: "size" }, [rich(item.size ?? "")])]),
      make("span", { class: "t" }, [rich(item.text)]),
      ...(item.where ? [make("span", { class: "where mono" }, [item.where])] : []),
    ];
    const made = item.to ? make("button", { type: "button", class: "item" }, lines) : make("div", { class: "item" }, lines);
    if (item.to) {
      made.addEventListener("click", () => this.go(item.to));
      made.place = item.to;
    }
    if (!item.step) return [made];
    const copy = item.copy ? [make("span", { class: "copy" }, [make("code", {}, [item.copy]), button("Copy", (own) => this.copy(item.copy, own), { "aria-label": `copy: ${item.copy}` })])] : [];
    return [made, make("div", { class: "step" }, [make("b", {}, ["Next: "]), rich(item.step), ...copy])];
  }

  copy(text, own) {
    navigator.clipboard?.writeText(text);
    own.textContent = "Copied";
    say("copied");
  }

  /** Follows a card or a finding. */
  go(to) {
    if (to.point !== undefined) this.choose({ point: to.point }, "list");
    else if (to.row !== undefined) this.choose({ table: to.table, row: to.row }, "list");
    else if (this.tables.has(to.table) || byId(`s-${to.table}`)) this.open(to.table, to.filter);
    if (to.point !== undefined || to.row !== undefined) this.plan?.zoomTo();
  }

  /** Selects an observation, a point or nothing; every part of the page follows. */
  choose(selection, from) {
    if (selection.row !== undefined && selection.table === undefined) selection.table = this.observations?.id;
    this.selection = selection;
    const points = this.pointsOf(selection);
    this.tables.forEach((table, id) => table.follow(selection, from === id));
    this.plan?.follow(points);
    for (const item of document.querySelectorAll(".item")) item.setAttribute("aria-current", String(Boolean(item.place) && this.isSame(item.place, selection)));
    this.showSelection();
    const name = this.nameOf(selection);
    if (name) say(`${name} selected`);
    if (name && from && from !== "plan") this.pin();
    const address = selection.point !== undefined ? `#p${encodeURIComponent(this.content.names[selection.point])}` : selection.row !== undefined && selection.table === this.observations?.id ? `#o${selection.row}` : location.pathname;
    history.replaceState(null, "", address);
  }

  isSame(place, selection) {
    return place.point !== undefined ? place.point === selection.point : place.row !== undefined && place.row === selection.row && place.table === selection.table;
  }

  pointsOf(selection) {
    if (selection.point !== undefined) return [selection.point];
    const table = this.tables.get(selection.table)?.content;
    return (table?.columns ?? []).filter((column) => column.quantity === "point" && column.key !== "backsight").map((column) => column.values[selection.row]).filter((value) => value !== null);
  }

  nameOf(selection) {
    const points = this.pointsOf(selection).map((point) => this.content.names[point]);
    if (selection.point !== undefined || selection.row === undefined) return points[0];
    const table = this.tables.get(selection.table);
    const type = columnOf(table.content, "type");
    return `${type ? `${table.text(type, selection.row)} ` : ""}${points.join(" → ")}`;
  }

  showSelection() {
    const [place, name] = [byId("selbox"), this.nameOf(this.selection)];
    if (!name) {
      place.replaceChildren(make("p", {}, ["Click a point, a line, a row. ", make("kbd", {}, ["Esc"]), " clears."]));
      return;
    }
    const table = [...this.tables.values()].find((item) => (this.selection.point === undefined ? item.content.id === this.selection.table : item.content.rows === "point"));
    const row = this.selection.point === undefined ? this.selection.row : table?.content.columns.find((column) => column.quantity === "point").values.indexOf(this.selection.point);
    const columns = table && row >= 0 ? table.content.columns.filter((column) => column.quantity !== "point" && column.key !== "type" && column.values[row] !== null).slice(0, MOST_SELECTED) : [];
    const cells = columns.flatMap((column) => [make("dt", {}, [column.title]), make("dd", {}, [`${table.text(column, row)} ${titleUnit(column)}`.trim()])]);
    const rows = this.selection.point !== undefined ? "Show its observations" : "Show its row";
    place.replaceChildren(
      make("h3", {}, [name, button("✕", () => this.choose({}), { class: "btn x", "aria-label": "clear the selection" })]),
      make("dl", {}, cells),
      make("div", { class: "acts" }, [...(this.plan ? [button("Zoom to it", () => this.plan.zoomTo())] : []), ...(this.observations ? [button(rows, () => this.showRows())] : [])]),
    );
  }

  showRows() {
    const { point, table } = this.selection;
    if (point === undefined) {
      this.open(table);
      this.tables.get(table).bring();
    } else this.open(this.observations.id, this.content.names[point].replaceAll(/\s+/g, " "));
    this.pin();
  }

  showTabs() {
    const inside = new Set(this.content.sections.flatMap((section) => section.tables ?? []));
    const tabs = [...this.content.tables.filter((table) => !inside.has(table.id)).map((table) => [table.id, table.title, table.size]), ...this.content.sections.map((section) => [section.key, section.title, ""])];
    byId("tabs").append(...tabs.map(([id, title, count]) => {
      const tab = make("button", { type: "button", role: "tab", id: `tab-${id}`, "aria-controls": `s-${id}` }, [title, " ", make("span", { class: "count" }, [String(count)])]);
      tab.addEventListener("click", () => this.open(id));
      return tab;
    }));
    byId("sections").append(...tabs.map(([id]) => make("section", { class: "section", role: "tabpanel", id: `s-${id}`, "aria-labelledby": `tab-${id}`, hidden: "" })));
    byId("tabs").addEventListener("keydown", (event) => this.pressedTab(event));
    this.tabs = tabs.map(([id]) => id);
    this.tables.forEach((table, id) => byId(`s-${id}`)?.append(table.element));
  }

  pressedTab(event) {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const now = this.tabs.indexOf(this.shown);
    if (!by) return;
    this.open(this.tabs[(now + by + this.tabs.length) % this.tabs.length]);
    byId(`tab-${this.shown}`).focus();
  }

  /** Shows a tab, and of its table what a filter keeps. */
  open(id, filter) {
    if (!this.tabs.includes(id)) return;
    const isFirst = this.shown === undefined;
    this.shown = id;
    for (const name of this.tabs) {
      byId(`tab-${name}`).setAttribute("aria-selected", String(name === id));
      byId(`tab-${name}`).tabIndex = name === id ? 0 : -1;
      byId(`s-${name}`).hidden = name !== id;
    }
    const table = this.tables.get(id);
    if (filter !== undefined) table?.setFilter(filter);
    table?.bring();
    if (!isFirst && filter !== undefined) byId("tabs").scrollIntoView();
  }

  chartsOf(section) {
    return (section.charts ?? []).map((content) => drawn(content, this.content.tables, this.content.limit));
  }

  fillSections() {
    for (const section of this.content.sections) {
      const tables = (section.tables ?? []).filter((id) => this.tables.has(id)).flatMap((id) => [make("h2", {}, [this.tables.get(id).content.title]), this.tables.get(id).element]);
      const words = section.words?.length ? [make("details", {}, [make("summary", {}, ["How to read this page"]), facts(section.words)])] : [];
      byId(`s-${section.key}`).replaceChildren(
        ...(section.note ? [make("p", { class: "note" }, [rich(section.note)])] : []),
        ...(section.charts?.length ? [make("div", { class: "charts" }, this.chartsOf(section))] : []),
        ...tables,
        ...(section.facts?.length ? [facts(section.facts)] : []),
        ...words,
      );
    }
  }

  showPlan() {
    const { content } = this;
    const suspected = new Set(content.tables.find((table) => table === this.observations)?.suspected ?? []);
    const sights = new Sights(this.observations && columnOf(this.observations, "from") ? this.observations : content.plan.lines, suspected, content.plan);
    const motions = new Motions(content.tables.find((table) => table.id === "undetermined"));
    motions.choose(content.plan.x.length);
    content.plan.limit = content.limit;
    this.plan = new Plan(byId("map"), content.plan, content.names, sights, motions, (...chosen) => this.choose(...chosen));
    this.plan.changed = () => this.showLegend();
    this.plan.told = (found, place) => this.tip(found, place);
    this.plan.hint = () => this.hint();
    this.showLayers();
    for (const zoom of document.querySelectorAll("[data-zoom]")) zoom.addEventListener("click", () => (Number(zoom.dataset.zoom) ? this.plan.zoom(Number(zoom.dataset.zoom)) : this.plan.fit()));
    byId("unpin").addEventListener("click", () => this.unpin());
    new IntersectionObserver(([entry]) => {
      this.isFar = entry.intersectionRatio < 0.35;
      if (!this.isFar) this.unpin();
    }, { threshold: 0.35 }).observe(byId("planslot"));
  }

  showLayers() {
    const { plan } = this;
    const { content, sights, motions } = plan;
    const offered = { names: "names", ...(plan.usual > 0 ? { ellipses: content.scheme ? "circles" : "ellipses" } : {}), ...(content.moved ? { moved: content.displaced ?? "displacements" } : {}), ...(plan.hasResiduals && plan.longest > 0 ? { residuals: "residuals" } : {}), ...(sights.list.length ? { sights: content.sights ?? "sights" } : {}), ...(content.scheme ? {} : { grid: "grid" }) };
    const boxes = Object.entries(offered).map(([name, text]) => checkbox(text, plan.layers[name], (on) => {
      plan.layers[name] = on;
      plan.redraw();
    }));
    const loose = motions.names.map((name, k) => checkbox(name, motions.shown.has(k), (on) => {
      motions.shown[on ? "add" : "delete"](k);
      plan.redraw();
    }));
    const kinds = sights.types.length > 1 ? sights.types.map((type, k) => checkbox(type, true, (on) => {
      plan.visible[on ? "add" : "delete"](k);
      plan.redraw();
    })) : [];
    const colours = { none: "plain", ...(kinds.length ? { type: "type" } : {}), ...(sights.measures.w ? { w: "residual" } : {}), ...(sights.measures.redundancy ? { redundancy: "redundancy" } : {}) };
    const menu = (title, parts) => (parts.length ? [make("details", { class: "menu" }, [make("summary", { class: "btn" }, [title]), make("div", {}, parts)])] : []);
    const size = make("input", { type: "range", min: "-2", max: "2", step: "0.1", value: "0", "aria-label": "size of ellipses and arrows" });
    size.addEventListener("input", () => {
      plan.enlarged = 2 ** Number(size.value);
      plan.redraw();
    });
    const views = content.views ? [choice("view", Object.fromEntries(content.views.map((view, k) => [k, view.name])), "0", (k) => this.view(content.views[k]))] : [];
    byId("planbar").append(...boxes, ...menu("kinds", kinds), ...menu("not determined", loose), ...views, ...(Object.keys(colours).length > 1 ? [choice("colour of sights", colours, "none", (name) => {
      plan.colouring = name;
      plan.redraw();
    })] : []), size);
  }

  /** Another projection of the same points. */
  view(view) {
    Object.assign(this.plan.content, view);
    this.plan.measure();
    this.plan.fit();
  }

  legendParts() {
    const { plan } = this;
    const { content } = plan;
    const has = (mark) => content.marks.some((marks) => marks & mark);
    const types = plan.colouring === "type" ? plan.sights.types.map((type, k) => ["line", TYPE_COLOURS[k % TYPE_COLOURS.length], type]) : [];
    const classes = ["w", "redundancy"].includes(plan.colouring) ? plan.classes().map(({ name, text }) => ["line", colour(name), text]) : [];
    const { unplaced } = content;
    const more = unplaced.length > MOST_UNPLACED ? ` and ${unplaced.length - MOST_UNPLACED} more (the findings name them)` : "";
    return [
      ...(has(KNOWN) ? [["triangle", "tx", content.known ?? "known point"]] : []),
      ...(has(STATION) ? [["ring", "tx", "station"]] : []),
      ...(has(CAMERA) ? [["camera", "tx", "camera"]] : []),
      ...(content.marks.some((marks) => !marks) ? [["dot", "tx", content.other ?? "point"]] : []),
      ...(has(UNDETERMINED) ? [["cross", "bad", "not determined"]] : []),
      ...(plan.layers.ellipses && plan.usual > 0 ? [["ellipse", "ell", content.ellipses]] : []),
      ...(plan.layers.moved && content.moved ? [["arrow", "vec", content.displacements]] : []),
      ...(plan.layers.residuals ? [["arrow", "res", "residual, on its sight"]] : []),
      ...(plan.sights.list.some((pair) => pair.isHot) ? [["line", "bad", "suspected"]] : []),
      ...types, ...classes,
      ...(content.loose.length ? [["arrow", "sel", "direction that nothing holds"]] : []),
      ...(content.rays.length ? [["line", "bad", "sight to a point without a place"]] : []),
      ...(unplaced.length ? [["", "", `not determined, and without a place: ${unplaced.slice(0, MOST_UNPLACED).join(", ")}${more}`]] : []),
      ...(plan.motions.shown.size ? [["", "", "arrows in colours: motions that no observation sees (a ring: along the vertical)"]] : []),
      ...(plan.isCut ? [["", "", `the first ${MOST_SIGHTS} sights in view: enlarge the plan for the others`]] : []),
      ...(content.scheme ? [["", "", content.title]] : []),
    ];
  }

  legendText() {
    return this.legendParts().map(([shape, , text]) => (shape ? `${shape}: ${text}` : text)).join("; ");
  }

  showLegend() {
    const shapes = { triangle: "M9 1l6.5 12h-13z", camera: "M1 12h16l-5-10h-6z", dot: "M5.8 7a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0-6.4 0" };
    const outlines = { ring: "M4 7a5 5 0 1 0 10 0a5 5 0 1 0-10 0", cross: "M4 2l10 10M4 12L14 2", ellipse: "M1 7a8 5 0 1 0 16 0a8 5 0 1 0-16 0", arrow: "M1 10L16 3M10 3l6 0l-3 5", line: "M0 7h18" };
    const key = JSON.stringify(this.legendParts());
    if (key === this.legendKey) return;
    this.legendKey = key;
    byId("legend").replaceChildren(...this.legendParts().map(([shape, name, text]) => {
      const style = name.startsWith("#") ? name : `var(--${name})`;
      const parts = shapes[shape] ? { d: shapes[shape], fill: style } : { d: outlines[shape] ?? "", fill: "none", stroke: style, "stroke-width": 2 };
      return make("span", {}, [...(shape ? [svg("svg", { width: 18, height: 14, viewBox: "0 0 18 14", "aria-hidden": "true" }, [svg("path", parts)])] : []), text]);
    }));
  }

  /** What is below the pointer, and where it is. */
  tip(found, place) {
    const name = found.point === undefined && found.row === undefined ? null : this.nameOf(found.row === undefined ? found : { ...found, table: this.observations?.id });
    byId("tip").hidden = !name;
    if (name) {
      byId("tip").textContent = name;
      byId("tip").style.left = `${Math.max(70, Math.min(this.plan.width - 70, place[0]))}px`;
      byId("tip").style.top = `${Math.max(30, place[1])}px`;
    }
    if (!place || this.plan.content.scheme) byId("where").textContent = "";
    else {
      const unit = quantity("length");
      const axes = this.plan.content.axes ?? ["x", "y"];
      byId("where").textContent = this.plan.at(...place).map((value, k) => `${axes[k]} ${grouped(fixed(value * unit.factor, 2))}`).join("  ");
    }
  }

  hint() {
    byId("hint").hidden = false;
    clearTimeout(this.hinting);
    this.hinting = setTimeout(() => { byId("hint").hidden = true; }, 1200);
  }

  /** Keeps the plan in sight beside a table. */
  pin() {
    if (!this.isFar || !this.plan) return;
    byId("planslot").style.height = `${byId("planslot").offsetHeight}px`;
    byId("planpane").classList.add("pinned");
  }

  unpin() {
    byId("planpane").classList.remove("pinned");
    byId("planslot").style.height = "";
  }

  listen() {
    const form = byId("settings");
    for (const name of ["angles", "lengths", "language"]) form.elements[name].value = settings[name];
    form.addEventListener("change", () => this.set(form));
    form.elements.theme.addEventListener("click", () => this.choosePaint(this.isDark ? "light" : "dark"));
    form.elements.print.addEventListener("click", () => window.print());
    form.elements.drawing.addEventListener("click", () => save(`${this.content.title.replace(/\W+/g, "-")}.svg`, this.drawing(), "image/svg+xml"));
    form.elements.drawing.hidden = !this.content.plan;
    document.addEventListener("keydown", (event) => this.pressed(event));
    this.system.addEventListener("change", () => this.paint(memory.get("theme")));
    window.addEventListener("beforeprint", () => this.print());
    window.addEventListener("afterprint", () => byId("paper").replaceChildren());
  }

  drawing() {
    return this.onPaper(() => new XMLSerializer().serializeToString(this.plan.svg(1000, 640)));
  }

  print() {
    this.onPaper(() => byId("paper").replaceChildren(...paper(this)));
  }

  /** What is made in the colours of paper. */
  onPaper(made) {
    const { theme } = document.documentElement.dataset;
    dress("light");
    const result = made();
    dress(theme);
    return result;
  }

  pressed(event) {
    const isWriting = /INPUT|SELECT|TEXTAREA/.test(document.activeElement.tagName);
    if (event.key === "Escape") {
      this.choose({});
      this.tables.forEach((table) => table.filter && table.setFilter(""));
    } else if (event.key === "/" && !isWriting) {
      event.preventDefault();
      document.querySelector("#sections section:not([hidden]) input")?.focus();
    }
  }

  set(form) {
    for (const name of ["angles", "lengths", "language"]) {
      settings[name] = form.elements[name].value;
      memory.set(name, settings[name]);
    }
    this.tables.forEach((table) => table.build());
    this.showHead();
    this.fillSections();
    this.plan?.redraw();
  }

  get isDark() {
    return document.documentElement.dataset.theme === "dark";
  }

  /** Shows the colours that are chosen, or else those of the system. */
  paint(theme) {
    dress(theme ?? (this.system.matches ? "dark" : "light"));
    this.plan?.redraw();
  }

  choosePaint(theme) {
    memory.set("theme", theme);
    this.paint(theme);
  }

  /** An address that ends in #pP05 or #o184 opens with that selected. */
  start() {
    if (this.tabs.length) this.open(this.tabs[0]);
    const [kind, name] = [location.hash[1], decodeURIComponent(location.hash.slice(2))];
    const point = kind === "p" ? this.content.names.indexOf(name) : -1;
    if (point >= 0) this.choose({ point });
    else if (kind === "o" && /^\d+$/.test(name) && Number(name) < (this.observations?.size ?? 0)) this.choose({ row: Number(name) });
    else if (this.content.first) this.choose({ ...this.content.first });
  }
}

let page;
(async () => {
  const content = JSON.parse(byId("content").textContent);
  const unpack = async (holder, name) => { if (holder[name]) holder[name] = await unpacked(holder[name]); };
  await Promise.all(content.tables.flatMap((table) => [...table.columns.map((column) => unpack(column, "values")), unpack(table, "angular"), unpack(table, "unused")]));
  scales = content.scales;
  page = new Page(content);
  document.documentElement.dataset.ready = "yes";
})();
