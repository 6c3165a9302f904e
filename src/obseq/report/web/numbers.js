// Numbers as the reader wants them: unit of angles, decimal mark. What the page holds is in metres and radians.

const settings = { lengths: "m", angles: "gon", language: "en" };

const PER_RADIAN = { gon: 200 / Math.PI, degree: 180 / Math.PI, dms: 180 / Math.PI };
const SMALL_PER_RADIAN = { gon: 200e3 / Math.PI, degree: 648e3 / Math.PI, dms: 648e3 / Math.PI };
const ANGLE_UNIT = { gon: "gon", degree: "°", dms: "" };
const SMALL_UNIT = { gon: "mgon", degree: "″", dms: "″" };
const PER_METRE = { m: 1, ft: 1 / 0.3048, "us-ft": 3937 / 1200 };
const ABSENT = "-";

/** What the text of a cell is made of: factor to the unit shown, decimals, unit. */
const QUANTITIES = {
  count: () => ({ factor: 1, decimals: 0, unit: "" }),
  number: () => ({ factor: 1, decimals: 2, unit: "" }),
  small_number: () => ({ factor: 1, decimals: -1, unit: "" }),
  share: () => ({ factor: 1, decimals: 2, unit: "" }),
  pixel: () => ({ factor: 1, decimals: 3, unit: "px" }),
  coarse_pixel: () => ({ factor: 1, decimals: 1, unit: "px" }),
  fine: () => ({ factor: 1, decimals: 4, unit: "" }),
  length: () => ({ factor: PER_METRE[settings.lengths], decimals: 4, unit: settings.lengths }),
  small_length: () => settings.lengths === "m" ? { factor: 1e3, decimals: 2, unit: "mm" } : { factor: PER_METRE[settings.lengths], decimals: 5, unit: settings.lengths },
  angle: () => ({ factor: PER_RADIAN[settings.angles], decimals: 5, unit: ANGLE_UNIT[settings.angles] }),
  small_angle: () => ({
    factor: SMALL_PER_RADIAN[settings.angles],
    decimals: settings.angles === "gon" ? 3 : 2,
    unit: SMALL_UNIT[settings.angles],
  }),
  bearing: () => ({ factor: PER_RADIAN[settings.angles], decimals: 1, unit: settings.angles === "gon" ? "gon" : "°" }),
};

const MIXED = { observed: ["length", "angle"], small: ["small_length", "small_angle"] };

/** How a column shows one of its rows: mixed columns hold lengths and angles. */
function scaleOf(column, isAngular) {
  if (MIXED[column.quantity]) return QUANTITIES[MIXED[column.quantity][isAngular ? 1 : 0]]();
  const scale = column.unit ? { factor: 1, decimals: 4, unit: column.unit } : QUANTITIES[column.quantity]();
  if (column.decimals !== undefined) scale.decimals = column.decimals;
  return scale;
}

/** The unit that the title of a column shows: none where each cell has its own. */
function titleUnit(column) {
  if (column.unit) return column.unit;
  return isText(column) || MIXED[column.quantity] ? "" : scaleOf(column, false).unit;
}

const isText = (column) => ["text", "choice", "point"].includes(column.quantity);

/** The sentence with its numbers in the units that are chosen: they stand in it as {{kind|value|digits}}. */
const rich = (text) => text.replace(/\{\{(\w+)\|([^|{}]+)\|(\d*)\}\}/g, (_, quantity, value, digits) => {
  const column = digits === "" ? { quantity } : { quantity, decimals: Number(digits) };
  const unit = scaleOf(column, false).unit;
  return `${shown(column, Number(value), false)}${unit ? ` ${unit}` : ""}`;
});

function fixed(value, decimals) {
  if (value === null || value === undefined || !Number.isFinite(value)) return ABSENT;
  if (decimals < 0) return significant(value);
  let text = value.toFixed(decimals);
  if (Number(text) === 0) text = text.replace("-", "");
  return settings.language === "fr" ? text.replace(".", ",") : text;
}

/** A long number with narrow blanks between its thousands. */
function grouped(text) {
  const [whole, ...rest] = text.split(/([.,])/);
  return (whole.replace("-", "").length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole) + rest.join("");
}

/** An angle in degrees, minutes and seconds to a tenth of a second. */
function sexagesimal(radians) {
  const tenths = Math.round(Math.abs(radians) * 6480e3 / Math.PI);
  const two = (number) => String(number).padStart(2, "0");
  const [degrees, minutes, rest] = [Math.floor(tenths / 36000), Math.floor(tenths / 600) % 60, tenths % 600];
  const seconds = fixed(rest / 10, 1).padStart(4, "0");
  return `${radians < 0 && tenths ? "-" : ""}${degrees}° ${two(minutes)}′ ${seconds}″`;
}

/** A value of a column as text. */
function shown(column, value, isAngular) {
  if (value === null || value === undefined) return ABSENT;
  const isSexagesimal = settings.angles === "dms" && (column.quantity === "angle" || (column.quantity === "observed" && isAngular));
  if (isSexagesimal) return sexagesimal(value);
  const scale = scaleOf(column, isAngular);
  const text = column.significant ? String(Number(value.toPrecision(column.significant))) : fixed(value * scale.factor, scale.decimals);
  return MIXED[column.quantity] && text !== ABSENT ? `${text} ${scale.unit}` : text;
}

/** Four significant digits, for axes and sentences. */
function significant(value) {
  const text = Number(value.toPrecision(4)).toString();
  return settings.language === "fr" ? text.replace(".", ",") : text;
}

/** The numbers of a packed column: bytes of equal weight stand together, compressed. */
async function unpacked(values) {
  if (Array.isArray(values)) return values;
  const bytes = Uint8Array.from(atob(values.bytes), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const shuffled = new Uint8Array(await new Response(stream).arrayBuffer());
  const Kind = { i4: Int32Array, f4: Float32Array, f8: Float64Array }[values.type];
  const [size, count] = [Kind.BYTES_PER_ELEMENT, shuffled.length / Kind.BYTES_PER_ELEMENT];
  const straight = new Uint8Array(shuffled.length);
  for (let k = 0; k < count; k += 1) for (let j = 0; j < size; j += 1) straight[k * size + j] = shuffled[j * count + k];
  const isMissing = values.type === "i4" ? (value) => value < 0 : Number.isNaN;
  return Array.from(new Kind(straight.buffer), (value) => (isMissing(value) ? null : value));
}
