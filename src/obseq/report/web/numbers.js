// Numbers as the reader wants them: unit of angles, decimal mark. What the page holds is in metres and radians.

const settings = { lengths: "m", angles: "gon", language: "en" };

const ABSENT = "-";
const TIE = 1 + 1e-14;
const [SMALLEST, LARGEST] = [-4, 7];

/** How quantities are shown, by unit: factor, decimals, sign of the unit; from the content of the page. */
let scales = {};

const quantity = (name) => scales.lengths[settings.lengths][name] ?? scales.angles[settings.angles][name] ?? scales.plain[""][name];

const MIXED = { observed: ["length", "angle"], small: ["small_length", "small_angle"] };

/** How a column shows one of its rows: mixed columns hold lengths and angles. */
function scaleOf(column, isAngular) {
  const scale = quantity(MIXED[column.quantity]?.[isAngular ? 1 : 0] ?? column.quantity);
  return { ...scale, ...(column.unit ? { unit: column.unit, factor: 1 } : {}), ...(column.decimals === undefined ? {} : { decimals: column.decimals }) };
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

const marked = (text) => (settings.language === "fr" ? text.replace(".", ",") : text);

function fixed(value, decimals) {
  if (value === null || value === undefined || !Number.isFinite(value)) return ABSENT;
  const text = (value * TIE).toFixed(decimals);
  return marked(Number(text) === 0 ? text.replace("-", "") : text);
}

/** A number with so many significant digits. */
function significant(value, digits = 4) {
  if (!Number.isFinite(value)) return ABSENT;
  const [mantissa, exponent] = (value * TIE).toExponential(digits - 1).split("e");
  const shortened = (text) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (exponent < SMALLEST || exponent >= LARGEST) return marked(`${shortened(mantissa)}e${Number(exponent)}`);
  return marked(shortened((value * TIE).toFixed(Math.max(0, digits - 1 - exponent))));
}

/** A long number with narrow blanks between its thousands. */
function grouped(text) {
  const [whole, ...rest] = text.split(/([.,])/);
  return (whole.replace("-", "").length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole) + rest.join("");
}

/** An angle in degrees, minutes and seconds, as in field books. */
function sexagesimal(degrees) {
  const hundredths = Math.floor(Math.abs(degrees) * 360000 * TIE + 0.5);
  const two = (number) => String(number).padStart(2, "0");
  const seconds = fixed((hundredths % 6000) / 100, 2).padStart(5, "0");
  return `${degrees < 0 && hundredths ? "-" : ""}${Math.floor(hundredths / 360000)}-${two(Math.floor(hundredths / 6000) % 60)}-${seconds}`;
}

const KINDS = { fixed, significant, sexagesimal };

/** A value of a column as text. */
function shown(column, value, isAngular) {
  if (value === null || value === undefined) return ABSENT;
  const scale = scaleOf(column, isAngular);
  const text = KINDS[scale.kind](value * scale.factor, scale.decimals);
  return MIXED[column.quantity] && text !== ABSENT ? `${text} ${scale.unit}` : text;
}

/** The numbers of a packed column: bytes of equal weight stand together, compressed. */
async function unpacked(values) {
  if (Array.isArray(values)) return values;
  const shuffled = new Uint8Array(await inflated(values.bytes).arrayBuffer());
  const Kind = { i4: Int32Array, f4: Float32Array, f8: Float64Array }[values.type];
  const [size, count] = [Kind.BYTES_PER_ELEMENT, shuffled.length / Kind.BYTES_PER_ELEMENT];
  const straight = new Uint8Array(shuffled.length);
  for (let k = 0; k < count; k += 1) for (let j = 0; j < size; j += 1) straight[k * size + j] = shuffled[j * count + k];
  const number = { i4: (value) => (value < 0 ? null : value), f4: (value) => (Number.isNaN(value) ? null : Number(value.toPrecision(6))), f8: (value) => (Number.isNaN(value) ? null : value) }[values.type];
  return Array.from(new Kind(straight.buffer), number);
}
