// Small helpers: elements, text, canvases as sharp as the screen, and colours from the style sheet.

export const $ = (id) => document.getElementById(id);

/** An element with properties and children; text goes in as text, never as markup. */
export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Set the text only where it differs: a screen reader would read it again. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function describe(canvas, text) {
  if (canvas.getAttribute("aria-label") !== text) canvas.setAttribute("aria-label", text);
}

/** A canvas' context in units of CSS pixels, wiped, with its size; null while it is not laid out. */
export function brush(canvas) {
  const width = canvas.clientWidth, height = canvas.clientHeight, dense = window.devicePixelRatio || 1;
  if (!width || !height) return null;
  const pixels = [Math.round(width * dense), Math.round(height * dense)];
  if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
  const context = canvas.getContext("2d");
  context.setTransform(dense, 0, 0, dense, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

let colours = null;
const listeners = [];

/** A colour of the style sheet, such as "ink". */
export function colour(name) {
  colours ??= getComputedStyle(document.documentElement);
  return colours.getPropertyValue(`--${name}`).trim();
}

/** Called when light turns to dark, or back: what was drawn is to be drawn again. */
export function onTheme(listener) {
  listeners.push(listener);
}

window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  colours = null;
  listeners.forEach((listener) => listener());
});

export function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

export function number(value, digits = 2) {
  if (value === null || value === undefined) return "–";
  return value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1"); // there is no minus zero
}

export const words = (name) => name.replaceAll("_", " ");

/** Send a command; the reply, or an Error that says what was wrong. */
export async function post(path, body) {
  const reply = await fetch(path, {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
    keepalive: true,
  });
  const said = await reply.json().catch(() => ({ error: `the dashboard answered ${reply.status}` }));
  if (!reply.ok) throw new Error(said.error);
  return said;
}
