// The page: its content, its tables and its plan, linked by one selection.

class Page {
  constructor(content) {
    this.content = content;
    Object.assign(settings, { lengths: content.units.length, angles: content.units.angle });
    const choose = (selection) => this.choose(selection);
    this.tables = content.tables.map((table) => new Table(table, content.names, choose));
    this.observations = content.tables.find((table) => table.id === "observations");
    this.show();
    if (content.plan) this.showPlan(choose);
    this.showCharts();
    this.tables.forEach((table) => table.draw(true));
    this.tables[0]?.measureRow();
    this.listen();
  }

  show() {
    const place = document.getElementById("tables");
    place.append(...this.tables.map((table) => table.element));
    this.link("summary", "Summary");
    if (this.content.plan) this.link("plan", "Plan");
    if (this.content.iterations.length) this.link("charts", "Charts");
    for (const table of this.content.tables) this.link(table.id, table.short);
  }

  link(id, text) {
    document.getElementById("contents").append(make("a", { href: `#${id}` }, [text]));
  }

  showPlan(choose) {
    document.getElementById("plan").hidden = false;
    const sights = new Sights(this.observations);
    sights.typeOf = columnOf(this.observations, "type")?.values ?? [];
    const motions = new Motions(this.content.tables.find((table) => table.id === "undetermined"));
    motions.choose(this.content.plan.x.length);
    this.plan = new Plan(document.getElementById("map"), this.content.plan, this.content.names, sights, motions, choose);
    this.plan.legend = (text, colouring) => this.legend(text, colouring);
    this.showLayers(sights.types);
    for (const button of document.querySelectorAll("#buttons button")) button.addEventListener("click", () => this.zoomed(Number(button.dataset.zoom)));
  }

  zoomed(factor) {
    if (factor) this.plan.zoom(factor);
    else this.plan.fit();
  }

  showLayers(types) {
    const { plan } = this;
    const switches = Object.entries({ names: "names", ellipses: "ellipses", ...(plan.content.moved ? { moved: "displacements" } : {}) });
    const layers = switches.map(([name, text]) => checkbox(text, plan.layers[name], (on) => {
      plan.layers[name] = on;
      plan.redraw();
    }));
    const kinds = types.map((type, k) => checkbox(type, true, (on) => {
      plan.visible[on ? "add" : "delete"](k);
      plan.redraw();
    }));
    document.getElementById("layers").append(group("show", [...layers, this.larger()]), group("observations", kinds), ...this.motions(), this.colours());
  }

  /** Switches of the motions that no observation sees. */
  motions() {
    const { motions } = this.plan;
    const boxes = motions.names.map((name, k) => checkbox(name, motions.shown.has(k), (on) => {
      motions.shown[on ? "add" : "delete"](k);
      this.plan.redraw();
    }));
    return boxes.length ? [group("not determined", boxes)] : [];
  }

  larger() {
    const buttons = [["smaller", 0.5], ["larger", 2]].map(([text, factor]) => {
      const button = make("button", { type: "button", "aria-label": `draw ellipses and displacements ${text}` }, [factor > 1 ? "larger" : "smaller"]);
      button.addEventListener("click", () => {
        this.plan.enlarged *= factor;
        this.plan.redraw();
      });
      return button;
    });
    return make("span", {}, buttons);
  }

  colours() {
    const { measures } = this.plan.sights;
    const offered = { none: "one colour", type: "type", ...(measures.redundancy ? { redundancy: "reliability (redundancy)" } : {}), ...(measures.standardised ? { standardised: "standardised residual" } : {}) };
    const choice = make("select", { name: "colouring", "aria-label": "colour of sights" }, Object.entries(offered).map(([value, text]) => make("option", { value }, [text])));
    choice.addEventListener("change", () => {
      this.plan.colouring = choice.value;
      this.plan.redraw();
    });
    return group("colour of sights", [choice]);
  }

  legend(text, colouring) {
    const types = this.plan.sights.types.map((type, k) => [TYPE_COLOURS[k % TYPE_COLOURS.length], type]);
    const classes = CLASSES[colouring]?.colours.map((colour, k) => [colour, CLASSES[colouring].texts[k]]);
    const swatches = (colouring === "type" ? types : classes ?? []).flatMap(([colour, name]) => [make("span", { class: "swatch", style: `background:${colour}` }), `${name}  `]);
    document.getElementById("legend").replaceChildren(...swatches, text);
  }

  showCharts() {
    const { iterations } = this.content;
    if (!iterations.length) return;
    const column = columnOf(this.observations, "standardised") ?? columnOf(this.observations, "normalised");
    const place = make("div", { class: "charts" });
    const type = columnOf(this.observations, "type");
    const draw = (kind) => {
      const values = (column?.values ?? []).filter((value, row) => value !== null && (kind < 0 || type.values[row] === kind));
      place.replaceChildren(...(values.length ? [histogram(values, column.title + " residual"), normalPlot(values, column.title + " residual")] : []), ...(iterations.length ? [convergence(iterations)] : []));
    };
    const choice = make("select", { "aria-label": "residuals of which type" }, ["all types", ...(type?.choices ?? [])].map((text, k) => make("option", { value: k - 1 }, [text])));
    choice.addEventListener("change", () => draw(Number(choice.value)));
    draw(-1);
    this.drawCharts = () => draw(Number(choice.value));
    const title = make("h2", { id: "charts-title" }, ["Residuals and convergence"]);
    document.getElementById("tables").prepend(make("section", { id: "charts", "aria-labelledby": "charts-title" }, [title, make("div", { class: "tools" }, [choice]), place]));
  }

  listen() {
    const form = document.getElementById("settings");
    form.elements.lengths.value = settings.lengths;
    form.elements.angles.value = settings.angles;
    form.addEventListener("change", () => this.set(form));
    form.elements.print.addEventListener("click", () => window.print());
    this.system = window.matchMedia("(prefers-color-scheme: dark)");
    this.system.addEventListener("change", () => this.set(form));
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.choose({}));
    window.addEventListener("beforeprint", () => this.print());
    window.addEventListener("afterprint", () => this.refresh());
    this.paint(form);
  }

  set(form) {
    settings.lengths = form.elements.lengths.value;
    settings.angles = form.elements.angles.value;
    settings.language = form.elements.language.value;
    this.paint(form);
    this.refresh();
  }

  paint(form) {
    const theme = form.elements.theme.value;
    document.documentElement.toggleAttribute("data-dark", theme === "dark" || (theme === "auto" && this.system.matches));
    this.plan?.redraw();
  }

  refresh() {
    this.tables.forEach((table) => table.refresh());
    this.drawCharts?.();
    this.plan?.redraw();
  }

  print() {
    this.tables.forEach((table) => table.print());
    this.plan?.draw(true);
  }

  /** Selects points and a row, in every table and on the plan. */
  choose(selection) {
    const { names } = this.content;
    this.tables.forEach((table) => table.follow(selection));
    this.plan?.follow(selection);
    const points = (selection.points ?? []).map((point) => names[point]);
    document.getElementById("picked").textContent = points.length ? `selected: ${points.join(" → ")}${selection.only ? "; the tables show its rows only (Escape shows all)" : ""}` : "";
  }
}

function checkbox(text, isOn, changed) {
  const box = make("input", { type: "checkbox", ...(isOn ? { checked: "" } : {}) });
  box.addEventListener("change", () => changed(box.checked));
  return make("label", {}, [box, ` ${text}`]);
}

const group = (title, parts) => make("fieldset", {}, [make("legend", {}, [title]), ...parts]);

const page = new Page(JSON.parse(document.getElementById("content").textContent));
