// Paper: the same order, short and dense, the worst first.

const MOST_PRINTED = 400;
const MOST_OTHERS = 60;
const MOST_FINDINGS = [6, 5];
const A_PAGE = 67;
const MOST_CHARTS = 8;

/** The content of the page for paper. */
function paper(page) {
  const { content } = page;
  const findings = (content.lists ?? []).flatMap((list, k) => [make("h2", {}, [list.title]), make("ol", {}, list.items.slice(0, MOST_FINDINGS[k] ?? 4).map(printedFinding)),
    ...(list.items.length > (MOST_FINDINGS[k] ?? 4) ? [make("p", { class: "note" }, [`and ${list.items.length - (MOST_FINDINGS[k] ?? 4)} more in the page and the result file`])] : [])]);
  const parts = [
    make("h1", {}, [content.title]),
    make("p", { class: "note" }, [`${content.about}${content.run ? ` · run ${content.run}` : ""}`]),
    ...page.verdict(),
    make("div", { class: "cards" }, content.cards.map((item) => card(item, null, "div"))),
    ...findings,
    ...(page.plan ? [make("h2", {}, ["Plan"]), make("div", { class: "drawing" }, [page.plan.svg(900, 520)]), make("p", { class: "note" }, [page.legendText()])] : []),
  ];
  const tables = content.tables.filter((table) => table.size);
  const long = tables.filter((table) => table.rows && table.rows !== "point");
  for (const section of content.sections) {
    if (section.charts?.length) parts.push(make("h2", parts.some((part) => part.className === "break") ? {} : { class: "break" }, [section.title]), ...printedCharts(page.chartsOf(section)));
  }
  for (const table of tables.filter((item) => !long.includes(item))) parts.push(...printedTable(page, table));
  for (const section of content.sections) if (section.facts?.length) parts.push(make("h2", {}, [section.title]), facts(section.facts));
  for (const table of long) parts.push(...printedTable(page, table));
  return parts;
}

/** The first charts of a section; how many there are. */
function printedCharts(charts) {
  const more = charts.length > MOST_CHARTS ? [make("p", { class: "note" }, [`the first ${MOST_CHARTS} of ${charts.length}; the page has all`])] : [];
  return [make("div", { class: "charts" }, charts.slice(0, MOST_CHARTS)), ...more];
}

function printedFinding(item) {
  const where = item.where ? [make("span", { class: "mono" }, [` ${item.where}`])] : [];
  return make("li", {}, [make("b", {}, [item.title]), ` ${rich(item.size ?? "")}`, ...where, `: ${rich(item.text)}${item.step ? ` Next: ${rich(item.step)} ${item.copy ?? ""}` : ""}`]);
}

/** A table in the order of the page, the worst rows first; observations in two columns. */
function printedTable(page, content) {
  const table = page.tables.get(content.id);
  if (!table) return [];
  const columns = content.columns.filter((column) => !column.rare && column.paper !== false);
  const rows = table.sorted(Array.from({ length: content.size }, (_, k) => k));
  const kept = rows.slice(0, content.rows ? MOST_PRINTED : MOST_OTHERS);
  const more = rows.length > kept.length ? `, the first ${kept.length} of ${rows.length}; the result file has all` : "";
  const title = make("h2", {}, [content.title + more]);
  const printed = (some) => {
    const heads = columns.map((column) => make("th", isText(column) ? { class: "t" } : {}, [column.title, ...(titleUnit(column) ? [make("small", {}, [` ${titleUnit(column)}`])] : [])]));
    const lines = some.map((row) => make("tr", content.unused?.[row] ? { class: "off" } : {}, columns.map((column) => make("td", isText(column) ? { class: "t" } : {}, [String(table.text(column, row))]))));
    return make("table", {}, [make("thead", {}, [make("tr", {}, heads)]), make("tbody", {}, lines)]);
  };
  if (!content.rows || content.rows === "point") return [title, printed(kept)];
  const parts = [];
  for (let k = 0; k < kept.length; k += 2 * A_PAGE) {
    const half = Math.min(A_PAGE, Math.ceil((kept.length - k) / 2));
    parts.push(make("div", { class: "two" }, [printed(kept.slice(k, k + half)), printed(kept.slice(k + half, k + 2 * half))]));
  }
  title.className = "break";
  return [title, ...parts];
}

const facts = (rows) => make("dl", { class: "facts" }, rows.flatMap(([name, text]) => [make("dt", {}, [name]), make("dd", {}, [rich(text)])]));
