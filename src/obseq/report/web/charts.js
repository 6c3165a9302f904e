// Charts as SVG: residuals by type, their distribution, convergence, frames of images, correlations.

const CHART = { width: 420, height: 240, left: 46, right: 10, top: 10, bottom: 34 };
const MOST_DOTS = 800;
const TALL_IMAGE = 300;
const LONGEST_ARROW = 66;

/** Places of values on an axis of the chart: a function of the value. */
function axis(low, high, start, end) {
  return (value) => start + ((value - low) / (high - low || 1)) * (end - start);
}

/** Round values between two, about so many. */
function ticks(low, high, count) {
  const rough = (high - low || 1) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= rough * 0.999);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-6; value += step) found.push(Math.abs(value) < step * 1e-6 ? 0 : value);
  return found;
}

function frame(x, y, xTicks, yTicks, xTitle) {
  const base = CHART.height - CHART.bottom;
  const lines = [svg("path", { class: "axis", d: `M${CHART.left} ${CHART.top}V${base}H${CHART.width - CHART.right}` })];
  for (const { at, text } of xTicks) lines.push(svg("text", { x: x(at), y: base + 14, "text-anchor": "middle" }, [text]));
  for (const { at, text } of yTicks) {
    lines.push(svg("path", { class: "grid", d: `M${CHART.left} ${y(at).toFixed(1)}H${CHART.width - CHART.right}` }));
    lines.push(svg("text", { x: CHART.left - 5, y: y(at) + 4, "text-anchor": "end" }, [text]));
  }
  lines.push(svg("text", { x: (CHART.left + CHART.width) / 2, y: CHART.height - 4, "text-anchor": "middle" }, [xTitle]));
  return lines;
}

const labelled = (values) => values.map((at) => ({ at, text: significant(at) }));

function chart(title, about, parts, height = CHART.height) {
  const picture = svg("svg", { viewBox: `0 0 ${CHART.width} ${height}`, role: "img", "aria-label": `${title}: ${about}` }, parts);
  return make("figure", {}, [make("figcaption", {}, [title]), picture, make("p", { class: "about" }, [about])]);
}

const density = (z) => Math.exp(-z * z / 2) / Math.sqrt(2 * Math.PI);

/** How often residuals fall in each class, and how often they would if they were normal. */
function histogram(values, name) {
  const [low, width] = [-5, 0.5];
  const counts = new Array(20).fill(0);
  for (const value of values) counts[Math.max(0, Math.min(19, Math.floor((value - low) / width)))] += 1;
  const expected = (z) => density(z) * values.length * width;
  const most = Math.max(...counts, expected(0), 1);
  const x = axis(-5, 5, CHART.left, CHART.width - CHART.right);
  const y = axis(0, most * 1.05, CHART.height - CHART.bottom, CHART.top);
  const bars = counts.map((count, k) => svg("path", { class: "bar", d: `M${x(low + k * width) + 0.5} ${y(0)}V${y(count)}H${x(low + (k + 1) * width) - 0.5}V${y(0)}Z` }, [svg("title", {}, [`${count}`])]));
  const curve = Array.from({ length: 101 }, (_, k) => -5 + k / 10).map((z, k) => `${k ? "L" : "M"}${x(z).toFixed(1)} ${y(expected(z)).toFixed(1)}`).join("");
  const parts = [...frame(x, y, labelled([-4, -2, 0, 2, 4]), labelled(ticks(0, most, 4)), name), ...bars, svg("path", { class: "curve", d: curve })];
  return chart("Histogram", `${values.length} values of ${name}; the curve is the normal distribution; the outer bars hold what lies beyond 5`, parts);
}

/** Quantile of the normal distribution (Acklam's rational approximation, 1e-9). */
function normalQuantile(p) {
  const a = [-39.69683028665376, 220.9460984245205, -275.9285104469687, 138.357751867269, -30.66479806614716, 2.506628277459239];
  const b = [-54.47609879822406, 161.5858368580409, -155.6989798598866, 66.80131188771972, -13.28068155288572, 1];
  const c = [-0.007784894002430293, -0.3223964580411365, -2.400758277161838, -2.549732539343734, 4.374664141464968, 2.938163982698783];
  const d = [0.007784695709041462, 0.3224671290700398, 2.445134137142996, 3.754408661907416, 1];
  const value = (coefficients, t) => coefficients.reduce((sum, k) => sum * t + k, 0);
  if (p > 0.5) return -normalQuantile(1 - p);
  if (p < 0.02425) {
    const t = Math.sqrt(-2 * Math.log(p));
    return value(c, t) / value(d, t);
  }
  const t = (p - 0.5) ** 2;
  return ((p - 0.5) * value(a, t)) / value(b, t);
}

/** Ordered residuals against what a normal distribution lets expect: a straight line when they are normal. */
function normalPlot(values, name) {
  const ordered = Float64Array.from(values).sort();
  const n = ordered.length;
  const step = Math.max(1, Math.floor(n / MOST_DOTS));
  const isShown = (k) => k % step === 0 || k < 20 || k >= n - 20;
  const reach = Math.max(4, Math.abs(ordered[0] ?? 0), Math.abs(ordered[n - 1] ?? 0));
  const x = axis(-4.5, 4.5, CHART.left, CHART.width - CHART.right);
  const y = axis(-1.05 * reach, 1.05 * reach, CHART.height - CHART.bottom, CHART.top);
  const dots = [];
  ordered.forEach((value, k) => {
    if (isShown(k)) dots.push(`M${(x(normalQuantile((k + 0.5) / n)) - 1.5).toFixed(1)} ${y(value).toFixed(1)}a1.5 1.5 0 1 0 3 0a1.5 1.5 0 1 0-3 0`);
  });
  const line = svg("path", { class: "curve", d: `M${x(-4)} ${y(-4)}L${x(4)} ${y(4)}` });
  const parts = [...frame(x, y, labelled([-4, -2, 0, 2, 4]), labelled(ticks(-reach, reach, 6)), "expected of a normal distribution"), line, svg("path", { class: "dot", d: dots.join("") })];
  return chart("Normal plot", `ordered values of ${name}; on the line where they are as the sigmas announce`, parts);
}

/** Sigma0 and the largest step of each iteration, on a logarithmic scale. */
function convergence(iterations) {
  const logs = (name) => iterations.map((row) => (row[name] > 0 ? Math.log10(row[name]) : null));
  const both = { "sigma0 at its start": ["line", logs("sigma0")], "largest step": ["curve", logs("step")] };
  const finite = Object.values(both).flatMap(([, values]) => values).filter((value) => value !== null);
  const [low, top] = [Math.floor(Math.min(...finite, 0)), Math.ceil(Math.max(...finite, 1))];
  const x = axis(1, Math.max(iterations.length, 2), CHART.left + 8, CHART.width - CHART.right - 8);
  const y = axis(low, top, CHART.height - CHART.bottom, CHART.top);
  const powers = ticks(low, top, 5).filter(Number.isInteger).map((at) => ({ at, text: `1e${at}` }));
  const numbers = ticks(1, iterations.length, 8).filter(Number.isInteger).map((at) => ({ at, text: String(at) }));
  const lines = Object.values(both).map(([style, values]) => svg("path", { class: style, d: path(values.map((value, k) => (value === null ? null : [x(k + 1), y(value)]))) }));
  return chart("Convergence", `by iteration: ${Object.keys(both).join(" (full) and ")} (dashed)`, [...frame(x, y, numbers, powers, "iteration"), ...lines]);
}

/** Every w on the line of its type. */
function bands(groups, limit) {
  const reach = Math.max(limit * 1.1, ...groups.flatMap(([, values]) => values.map(Math.abs)));
  const isLong = reach > 20;
  const size = (value) => (isLong ? Math.sign(value) * Math.log1p(Math.abs(value)) : value);
  const x = axis(size(-reach), size(reach), CHART.left + 20, CHART.width - CHART.right);
  const step = (CHART.height - CHART.bottom - CHART.top) / groups.length;
  const marks = [-limit, 0, limit].map((value) => svg("path", { class: value ? "limit" : "axis", d: `M${x(size(value))} ${CHART.top}V${CHART.height - CHART.bottom}` }));
  const rows = groups.flatMap(([name, values], k) => {
    const y = CHART.top + (k + 0.5) * step;
    const every = Math.max(1, Math.ceil(values.length / MOST_DOTS));
    const dots = values.filter((value, n) => n % every === 0 || Math.abs(value) > limit);
    const line = (isBad) => dots.filter((value) => (Math.abs(value) > limit) === isBad).map((value) => `M${x(size(value)).toFixed(1)} ${(y - 6).toFixed(1)}v12`).join("");
    return [svg("text", { x: CHART.left + 12, y: y + 4, "text-anchor": "end" }, [name]), svg("path", { class: "stroke plain", d: line(false) }), svg("path", { class: "stroke bad", d: line(true) })];
  });
  const texts = [-limit, limit].map((value) => svg("text", { x: x(size(value)), y: CHART.height - CHART.bottom + 14, "text-anchor": "middle" }, [fixed(value, 2)]));
  return chart("w by type", `each observation a tick${isLong ? "; logarithmic" : ""}; beyond the limit in red`, [...marks, ...rows, ...texts]);
}

/** Units of a chart for a pixel of an image that fills it. */
const scaleOfImage = (width, height) => Math.min((CHART.width - 20) / width, TALL_IMAGE / height);

/** A number in a cell that is coloured as strongly as it says. */
const inside = (x, y, text, strength) => svg("text", { x, y: y + 3.5, class: strength > 0.5 ? "in light" : "in" }, [text]);

/** Residuals on the frame of an image or a camera, enlarged; suspected ones in rings. */
function imageFrame({ title, width, height, x, y, dx, dy, suspected, note }) {
  const [scale, base] = [scaleOfImage(width, height), height * scaleOfImage(width, height) + 10];
  const lengths = dx.map((value, k) => Math.hypot(value, dy[k]));
  const usualOnes = lengths.filter((_, k) => !suspected.includes(k));
  const factor = 22 / (high(usualOnes, 0.95) || high(lengths, 1) || 1);
  const place = (k) => [10 + x[k] * scale, 10 + y[k] * scale];
  const arrows = new SvgPath();
  dx.forEach((value, k) => {
    const by = factor * Math.min(1, LONGEST_ARROW / (lengths[k] * factor || 1));
    arrow(arrows, ...place(k), place(k)[0] + value * by, place(k)[1] + dy[k] * by);
  });
  const cut = high(lengths, 1) * factor > LONGEST_ARROW ? `; arrows beyond ${significant(LONGEST_ARROW / factor)} px are drawn shorter` : "";
  const rings = suspected.map((k) => svg("circle", { cx: place(k)[0], cy: place(k)[1], r: 7, class: "ring bad" }));
  const usual = roundBelow(30 / factor);
  const parts = [svg("rect", { x: 10, y: 10, width: width * scale, height: height * scale, class: "axis" }), svg("path", { d: arrows.d, class: "arrow" }), ...rings,
    svg("path", { d: `M14 ${base + 10}h${usual * factor}`, class: "arrow" }), svg("text", { x: 20 + usual * factor, y: base + 14 }, [`${significant(usual)} px`])];
  return chart(title, `${note}${cut}`, parts, base + 20);
}

/** Residuals by the distance from the principal point. */
function profile({ title, radius, mean, rms, note }) {
  const top = 1.05 * Math.max(...rms, ...mean.map(Math.abs), 1e-9);
  const x = axis(0, Math.max(...radius, 1), CHART.left, CHART.width - CHART.right);
  const y = axis(-top, top, CHART.height - CHART.bottom, CHART.top);
  const line = (values, style) => svg("path", { class: style, d: path(values.map((value, k) => [x(radius[k]), y(value)])) });
  return chart(title, note, [...frame(x, y, labelled(ticks(0, Math.max(...radius, 1), 5)), labelled(ticks(-top, top, 5)), "px"), line(rms, "line"), line(mean, "curve")]);
}

/** A matrix of correlations: the stronger, the darker. */
function matrix({ title, names, values, note = "" }) {
  const step = Math.min(30, (CHART.width - 60) / names.length);
  const cells = values.flatMap((row, i) => row.map((value, j) => svg("rect", { x: 50 + j * step, y: 20 + i * step, width: step - 2, height: step - 2, class: value < 0 ? "negative" : "positive", opacity: (0.06 + 0.9 * Math.abs(value)).toFixed(2) }, [svg("title", {}, [`${names[i]}, ${names[j]}: ${fixed(value, 2)}`])])));
  const numbers = step < 24 ? [] : values.flatMap((row, i) => row.map((value, j) => inside(50 + (j + 0.5) * step, 20 + (i + 0.5) * step, i === j ? "" : fixed(100 * value, 0), Math.abs(value))));
  const labels = names.flatMap((name, i) => [svg("text", { x: 46, y: 20 + i * step + step / 2 + 4, "text-anchor": "end" }, [name]), svg("text", { x: 50 + i * step + step / 2, y: 14, "text-anchor": "middle" }, [name])]);
  return chart(title, note, [...cells, ...numbers, ...labels], Math.max(CHART.height, 30 + names.length * step));
}

/** A grid, and where its knots would be: the image without distortion. */
function distortedGrid({ title, width, height, x, y, note = "" }) {
  const [scale, side] = [scaleOfImage(width, height), Math.round(Math.sqrt(x.length))];
  const place = (k) => (x[k] === null ? null : [10 + x[k] * scale, 10 + y[k] * scale]);
  const lines = Array.from({ length: side }, (_, i) => [Array.from({ length: side }, (__, j) => place(i * side + j)), Array.from({ length: side }, (__, j) => place(j * side + i))]).flat();
  const given = Array.from({ length: side }, (_, i) => `M10 ${10 + i * height * scale / (side - 1)}h${width * scale}M${10 + i * width * scale / (side - 1)} 10v${height * scale}`).join("");
  return chart(title, note, [svg("path", { d: given, class: "grid" }), svg("path", { d: lines.map(path).join(""), class: "arrow" })], height * scale + 20);
}

/** How many image points each part of a frame has; a part without any is left white. */
function coverage({ title, width, height, counts, note = "" }) {
  const [scale, rows, most] = [scaleOfImage(width, height), counts.length, Math.max(...counts.flat(), 1)];
  const [wide, tall] = [width * scale / counts[0].length, height * scale / rows];
  const cells = counts.flatMap((row, j) => row.flatMap((count, i) => {
    const at = { x: 10 + i * wide, y: 10 + j * tall, width: wide - 1, height: tall - 1 };
    const shade = count ? { class: "positive", opacity: (0.15 + 0.8 * count / most).toFixed(2) } : { class: "grid" };
    return [svg("rect", { ...at, ...shade }, [svg("title", {}, [`${count} image points`])]), inside(at.x + wide / 2, at.y + tall / 2, String(count), count / most)];
  }));
  return chart(title, note, [...cells, svg("rect", { x: 10, y: 10, width: width * scale, height: height * scale, class: "grid" })], height * scale + 20);
}

function path(places) {
  let pen = "M";
  return places.map((place) => {
    const text = place ? `${pen}${place[0].toFixed(1)} ${place[1].toFixed(1)}` : "";
    pen = place ? "L" : "M";
    return text;
  }).join("");
}

/** What a section shows, made of what it declares. */
function drawn(content, tables, limit) {
  if (content.kind === "convergence") return convergence(content.iterations);
  if (content.kind === "frame") return imageFrame(content);
  if (content.kind === "profile") return profile(content);
  if (content.kind === "matrix") return matrix(content);
  if (content.kind === "grid") return distortedGrid(content);
  if (content.kind === "coverage") return coverage(content);
  const table = tables.find((item) => item.id === content.table);
  const [column, type] = [columnOf(table, content.column), columnOf(table, "type")];
  if (content.kind === "bands") {
    const groups = (type?.choices ?? ["all"]).map((name, k) => [name, column.values.filter((value, row) => value !== null && (!type || type.values[row] === k))]);
    return bands(groups.filter(([, values]) => values.length), limit ?? 3.29);
  }
  const values = column.values.filter((value) => value !== null);
  return content.kind === "histogram" ? histogram(values, content.column) : normalPlot(values, content.column);
}
