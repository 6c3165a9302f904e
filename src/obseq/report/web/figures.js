// Small drawings that carry meaning beside colour: marks of levels, and what a card compares its number with.

const ICONS = {
  bad: [["circle", { cx: 10, cy: 10, r: 9, fill: "currentColor" }], ["path", { d: "M6.5 6.5l7 7m0-7l-7 7", class: "inside" }]],
  warn: [["path", { d: "M10 1.5L19 18H1z", fill: "currentColor" }], ["path", { d: "M10 7v5m0 2v2", class: "inside" }]],
  ok: [["circle", { cx: 10, cy: 10, r: 9, fill: "currentColor" }], ["path", { d: "M5.5 10.5l3 3 6-7", class: "inside" }]],
  info: [["circle", { cx: 10, cy: 10, r: 8, class: "ring" }], ["path", { d: "M10 9v5m0-8v1.6", class: "ring" }]],
};

const icon = (level, size = 20) => svg("svg", { class: `icon ${level}`, width: size, height: size, viewBox: "0 0 20 20", "aria-hidden": "true" }, ICONS[level].map(([tag, attributes]) => svg(tag, attributes)));

const WIDE = 200;
const TALL = 26;

const figure = (parts, label) => svg("svg", { viewBox: `0 0 ${WIDE} ${TALL}`, ...(label ? { role: "img", "aria-label": label } : { "aria-hidden": "true" }) }, parts);
const small = (x, text, anchor = "middle") => svg("text", { x, y: 25, class: "tick", "text-anchor": anchor }, [text]);

const FIGURES = {
  /** A value against the interval where it is expected, on a logarithmic axis. */
  gauge({ value, lower, upper, level }) {
    const [low, high] = [Math.min(lower * 0.55, value / 1.5), Math.max(upper * 1.8, value * 1.4)];
    const x = (number) => 4 + (WIDE - 8) * Math.log(number / low) / Math.log(high / low);
    const style = value < lower || value > upper ? level : "ok";
    const middle = Math.max(24, Math.min(WIDE - 24, (x(lower) + x(upper)) / 2));
    return figure([
      svg("path", { d: `M4 9H${WIDE - 4}`, class: "axis" }),
      svg("rect", { x: x(lower), y: 4, width: Math.max(3, x(upper) - x(lower)), height: 10, rx: 2, class: "expected" }),
      svg("path", { d: `M${x(value)} 2v14`, class: `pointer ${style}` }),
      svg("circle", { cx: x(value), cy: 9, r: 4, class: `spot ${style}` }),
      small(middle, `${fixed(lower, 2)} – ${fixed(upper, 2)}`),
    ], `${fixed(value, 2)}; expected ${fixed(lower, 2)} to ${fixed(upper, 2)}`);
  },

  /** Every value a tick, the limit a line. */
  strip({ values, limit }) {
    const most = Math.max(...values, limit ?? 0) || 1;
    const isLong = limit && most > 20;
    const x = (value) => 3 + (WIDE - 6) * (isLong ? Math.log1p(value) / Math.log1p(most) : value / most);
    const ticks = values.map((value) => svg("path", { d: `M${x(value).toFixed(1)} 5v11`, class: `stroke ${limit && value > limit ? "bad" : "plain"}` }));
    const line = limit ? [svg("path", { d: `M${x(limit)} 1v19`, class: "limit" }), small(Math.min(x(limit), WIDE - 24), fixed(limit, 2))] : [];
    return figure([svg("path", { d: `M3 16H${WIDE - 3}`, class: "axis" }), ...ticks, ...line]);
  },

  /** How many values are in each class; the lowest are bad. */
  bins({ values, low, first, last }) {
    const [most, step] = [Math.max(...values, 1), (WIDE - 6) / values.length];
    const bars = values.map((count, k) => svg("rect", { x: 3 + k * step, y: 18 - 16 * count / most, width: step - 1.5, height: count ? Math.max(1, 16 * count / most) : 0, class: k < low ? "fill bad" : "fill plain" }));
    return figure([...bars, small(3, first, "start"), small(WIDE - 3, last, "end")]);
  },

  /** What is bad and what is weak of a whole. */
  share({ part, second, whole }) {
    const width = (count) => (count ? Math.max(2, (WIDE - 6) * count / whole) : 0);
    return figure([
      svg("rect", { x: 3, y: 5, width: WIDE - 6, height: 10, rx: 2, class: "expected" }),
      svg("rect", { x: 3, y: 5, width: width(part), height: 10, class: "fill bad" }),
      svg("rect", { x: 3 + width(part), y: 5, width: width(second), height: 10, class: "fill weak" }),
    ]);
  },
};

/** A card; a button where it leads somewhere. */
function card(content, go, tag = "button") {
  const { label, value, unit, note } = content;
  const parts = [
    make("span", { class: "l" }, [make("span", {}, [label]), ...(content.tag ? [make("span", { class: `tag ${content.tag[0]}` }, [content.tag[1]])] : [])]),
    make("span", { class: "b" }, [rich(value), ...(unit ? [make("small", {}, [rich(unit)])] : [])]),
    ...(content.figure ? [FIGURES[content.figure.kind](content.figure)] : []),
    make("span", { class: "n" }, [rich(note ?? "")]),
  ];
  if (tag === "div" || !content.to) return make("div", { class: "card" }, parts);
  const made = make("button", { type: "button", class: "card" }, parts);
  made.addEventListener("click", () => go(content.to));
  return made;
}
