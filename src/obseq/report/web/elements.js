// Elements of the page.

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

const make = (tag, attributes = {}, children = []) => fill(document.createElement(tag), attributes, children);
const svg = (tag, attributes = {}, children = []) => fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
const byId = (id) => document.getElementById(id);

function button(text, clicked, attributes = {}) {
  const made = make("button", { type: "button", class: "btn", ...attributes }, [text]);
  made.addEventListener("click", () => clicked(made));
  return made;
}

function checkbox(text, isOn, changed) {
  const box = make("input", { type: "checkbox", ...(isOn ? { checked: "" } : {}) });
  box.addEventListener("change", () => changed(box.checked));
  return make("label", {}, [box, ` ${text}`]);
}

function choice(label, options, value, changed) {
  const made = make("select", { class: "btn", "aria-label": label }, Object.entries(options).map(([key, text]) => make("option", { value: key }, [text])));
  made.value = value;
  made.addEventListener("change", () => changed(made.value));
  return made;
}

/** What is told to those who cannot see it. */
const say = (text) => { byId("live").textContent = text; };

let palette = null;

function dress(theme) {
  document.documentElement.dataset.theme = theme;
  palette = null;
}

/** A colour of the theme; read once for all that is drawn together. */
function colour(name) {
  if (!palette) {
    palette = new Map();
    queueMicrotask(() => { palette = null; });
  }
  if (!palette.has(name)) palette.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return palette.get(name);
}

/** What a browser remembers of a reader; nothing where it may not. */
const memory = {
  get(key) {
    try { return localStorage.getItem(`obseq-${key}`); } catch { return null; }
  },
  set(key, value) {
    try { localStorage.setItem(`obseq-${key}`, value); } catch { /* a page without storage */ }
  },
};

function save(name, text, type) {
  const link = make("a", { download: name, href: URL.createObjectURL(new Blob([text], { type })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
