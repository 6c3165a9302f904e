// Charts as SVG: histogram and normal plot of residuals, convergence.

const CHART = { width: 420, height: 240, left: 46, right: 10, top: 10, bottom: 34 };
const MOST_DOTS = 800;

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

function chart(title, about, parts) {
  const picture = svg("svg", { viewBox: `0 0 ${CHART.width} ${CHART.height}`, role: "img", "aria-label": `${title}: ${about}` }, parts);
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
  return chart("Histogram", `${values.length} ${name}s; the curve is the normal distribution; the outer bars hold what lies beyond 5`, parts);
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
  return chart("Normal plot", `ordered ${name}s; on the line where they are as the sigmas announce`, parts);
}

/** Sigma0 and the largest step of each iteration, on a logarithmic scale. */
function convergence(iterations) {
  const logs = (name) => iterations.map((row) => (row[name] > 0 ? Math.log10(row[name]) : null));
  const both = { "sigma0 at its start": ["line", logs("sigma0")], "largest step (m or rad)": ["curve", logs("max_step")] };
  const finite = Object.values(both).flatMap(([, values]) => values).filter((value) => value !== null);
  const [low, high] = [Math.floor(Math.min(...finite, 0)), Math.ceil(Math.max(...finite, 1))];
  const x = axis(1, Math.max(iterations.length, 2), CHART.left + 8, CHART.width - CHART.right - 8);
  const y = axis(low, high, CHART.height - CHART.bottom, CHART.top);
  const powers = ticks(low, high, 5).filter(Number.isInteger).map((at) => ({ at, text: `1e${at}` }));
  const numbers = ticks(1, iterations.length, 8).filter(Number.isInteger).map((at) => ({ at, text: String(at) }));
  const lines = Object.values(both).map(([style, values]) => svg("path", { class: style, d: path(values.map((value, k) => (value === null ? null : [x(k + 1), y(value)]))) }));
  return chart("Convergence", `by iteration: ${Object.keys(both).join(" (blue) and ")} (red)`, [...frame(x, y, numbers, powers, "iteration"), ...lines]);
}

function path(places) {
  let pen = "M";
  return places.map((place) => {
    const text = place ? `${pen}${place[0].toFixed(1)} ${place[1].toFixed(1)}` : "";
    pen = place ? "L" : "M";
    return text;
  }).join("");
}
