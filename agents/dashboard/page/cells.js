// Maps of targets and sensors. Targets on a line: a row each, near at the bottom, a column each sensor, as the paper draws
// them. All others: seen from above, x up and y left, one map a sensor.

import { brush, colour } from "./dom.js";

const UNKNOWN = 255;

export class Plan {
  /** Where each cell lies, for a robot's targets and sensors. */
  constructor(hello) {
    this.targets = hello.targets;
    this.sensors = hello.sensors;
    this.line = hello.kind === "line" || hello.targets.every(([, y, yaw]) => y === 0 && yaw === 0);
    const [xs, ys] = [0, 1].map((axis) => hello.targets.map((pose) => pose[axis]));
    this.low = [Math.min(...xs), Math.min(...ys)];
    this.high = [Math.max(...xs), Math.max(...ys)];
    this.step = this.line ? 1 : spacing(hello.targets);
  }

  get maps() {
    return this.line ? 1 : this.sensors.length;
  }

  /** Rectangles [x, y, width, height, target, sensor] within a map of this size. */
  *cells(width, height) {
    const sensors = this.sensors.length, targets = this.targets.length;
    if (this.line) {
      const across = width / sensors, up = height / targets;
      for (let t = 0; t < targets; t++)
        for (let s = 0; s < sensors; s++) yield [s * across, height - (t + 1) * up, across, up, t, s];
      return;
    }
    const span = [this.high[0] - this.low[0] + this.step, this.high[1] - this.low[1] + this.step];
    const gap = sensors > 1 ? 6 : 0, each = (width - gap * (sensors - 1)) / sensors;
    const scale = Math.min(each / span[1], height / span[0]), size = this.step * scale;
    for (let s = 0; s < sensors; s++) {
      const left = s * (each + gap) + (each - span[1] * scale) / 2;
      for (let t = 0; t < targets; t++) {
        const [x, y] = this.targets[t];
        yield [left + (this.high[1] - y) * scale, (this.high[0] - x) * scale, size, size, t, s];
      }
    }
  }
}

function spacing(targets) {
  let least = Infinity;
  for (let i = 1; i < targets.length; i++) {
    const apart = Math.hypot(targets[i][0] - targets[i - 1][0], targets[i][1] - targets[i - 1][1]);
    if (apart > 1e-6) least = Math.min(least, apart);
  }
  return Number.isFinite(least) ? least : 1;
}

/** Draw values, a byte each target and sensor, in the colour that `paint(value)` gives; `axes` adds distances and names. */
export function draw(canvas, plan, values, paint, axes = false) {
  const found = brush(canvas);
  if (!found) return;
  const { context, width, height } = found;
  const left = axes && plan.line ? 44 : 0, bottom = axes ? 34 : 0;
  context.translate(left, axes ? 4 : 0);
  const [inner, tall] = [width - left, height - bottom - (axes ? 4 : 0)];
  for (const [x, y, across, up, t, s] of plan.cells(inner, tall)) {
    const value = values ? values[t * plan.sensors.length + s] : null;
    context.fillStyle = paint(value, context);
    // A hair larger than the cell: no seams where edges fall between pixels.
    context.fillRect(x, y, across + (plan.line ? 0.4 : -0.6), up + (plan.line ? 0.4 : -0.6));
  }
  if (axes) label(context, plan, inner, tall);
}

function label(context, plan, width, height) {
  context.fillStyle = colour("quiet");
  context.font = "11px system-ui, sans-serif";
  context.textBaseline = "middle";
  if (plan.line) {
    context.textAlign = "right";
    const every = Math.max(1, Math.ceil(plan.targets.length / 6));
    for (let t = 0; t < plan.targets.length; t += every)
      context.fillText(`${plan.targets[t][0].toFixed(2)} m`, -6, height - ((t + 0.5) * height) / plan.targets.length);
  }
  context.textAlign = "center";
  const across = width / plan.sensors.length;
  plan.sensors.forEach((name, s) => {
    const lines = across < 90 ? name.split("_") : [name.replaceAll("_", " ")];
    lines.forEach((line, i) => context.fillText(line, (s + 0.5) * across, height + 11 + 12 * i, across - 2));
  });
}

let ramp = { key: "", colours: [] };

/** The colour of a probability: 0 to 255. */
export function predicted(value) {
  if (value === null || value === undefined) return colour("unknown");
  const stops = ["predicted-0", "predicted-1", "predicted-2"].map(colour), key = stops.join();
  if (ramp.key !== key) ramp = { key, colours: Array.from({ length: 256 }, (_, i) => blend(stops, i / 255)) };
  return ramp.colours[value];
}

function blend(stops, share) {
  const at = share * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2);
  const [from, to] = [stops[i], stops[i + 1]].map((text) => [1, 3, 5].map((n) => parseInt(text.slice(n, n + 2), 16)));
  return `rgb(${from.map((value, c) => Math.round(value + (to[c] - value) * (at - i))).join()})`;
}

/** The colour of a label: 1, 0, or unknown, hatched. */
export function felt(value, context) {
  if (value === 1) return colour("positive");
  if (value === 0) return colour("negative");
  return hatch(context);
}

const hatches = new Map();

function hatch(context) {
  const key = colour("unknown") + colour("hatch");
  if (!hatches.has(key)) {
    const tile = Object.assign(document.createElement("canvas"), { width: 6, height: 6 });
    const pen = tile.getContext("2d");
    pen.fillStyle = colour("unknown");
    pen.fillRect(0, 0, 6, 6);
    pen.strokeStyle = colour("hatch");
    pen.beginPath();
    for (const shift of [-6, 0, 6]) (pen.moveTo(shift, 6), pen.lineTo(shift + 6, 0));
    pen.stroke();
    hatches.set(key, tile);
  }
  return context.createPattern(hatches.get(key), "repeat");
}

/** In words: what a sensor is expected to feel nearest, for those who cannot see the map. */
export function inWords(plan, values) {
  const width = plan.sensors.length;
  const said = plan.sensors.map((name, s) => {
    let best = null;
    plan.targets.forEach(([x, y], t) => {
      const metres = Math.hypot(x, y);
      if (values[t * width + s] >= 128 && (best === null || metres < best)) best = metres;
    });
    return best === null ? null : `${name.replaceAll("_", " ")} at ${best.toFixed(2)} m`;
  });
  const found = said.filter(Boolean);
  return found.length ? `Expects to feel something: ${found.join(", ")}.` : "Expects to feel nothing.";
}

export function knownShare(values) {
  let known = 0;
  for (const value of values) known += value !== UNKNOWN;
  return known / values.length;
}
