// The robot from above: its path, where sensors fired, its targets, the window in force, how well its pose is known.

import { $, brush, colour, describe, make, onTheme, say, words } from "./dom.js";
import { predicted } from "./cells.js";
import { bytes } from "./dom.js";

const MOST_POINTS = 4000, MOST_FIRED = 1500;
const LEAST_ELLIPSE_PX = 7;

export class Ground {
  constructor() {
    this.clear();
    this.prediction = null;
    onTheme(() => this.paint());
    new ResizeObserver(() => this.paint()).observe($("map"));
  }

  hello(hello) {
    this.about = hello;
    this.clear();
    $("map-legend").replaceChildren(
      make("span", {}, make("i", { className: "path" }), "path"),
      make("span", {}, make("i", { className: "window" }), "within the label window"),
      make("span", {}, make("i", { className: "target" }), "targets"),
      make("span", {}, make("i", { className: "ellipse" }), "where it may be (2σ), as seen from the window's end"),
      ...hello.sensors.map((name, s) => make("span", {}, make("i", { className: `s${s % 5}` }), `${words(name)} fired`)),
    );
  }

  clear() {
    this.path = [];
    this.fired = [];
    this.window = this.pose = null;
    this.nowS = 0;
  }

  update(told) {
    if (told.anew) this.clear();
    this.path.push(...(told.path ?? []));
    this.fired.push(...(told.fired ?? []));
    this.path.splice(0, this.path.length - MOST_POINTS);
    this.fired.splice(0, this.fired.length - MOST_FIRED);
    if (told.prediction) this.prediction = bytes(told.prediction);
    if (told.window !== undefined) this.window = told.window;
    if (!told.pose) return;
    this.pose = told.pose;
    this.nowS = told.robot_s;
    this.paint();
    if (told.agents) this.tell();
  }

  tell() {
    if (!this.window) return;
    const [back, reached, long] = this.window;
    const rule = this.about.window === "drift" ? `until its pose is known to ${(100 * this.about.gate_m).toFixed(1)} cm only` : "by the clock";
    say($("map-said"), `The label window reaches ${back.toFixed(0)} s back, ${rule}; in it the robot got ${reached.toFixed(2)} m away, ` +
      `and its pose is known to ${(2000 * long).toFixed(1)} mm (2σ).`);
    const [x, y, yaw] = this.pose;
    describe($("map"), `Robot at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, heading ${Math.round((180 * yaw) / Math.PI)} degrees. ${this.fired.length} places where a sensor fired.`);
  }

  paint() {
    const found = brush($("map"));
    if (!found || !this.pose) return;
    const { context, width, height } = found;
    const view = this.fit(width, height);
    this.grid(context, view, width, height);
    this.lines(context, view);
    this.marks(context, view);
    this.ellipse(context, view);
    this.targets(context, view);
    this.robot(context, view);
  }

  /** From metres to pixels: all that is drawn, in the middle, x to the right and y up. */
  fit(width, height) {
    const xs = [this.pose[0]], ys = [this.pose[1]];
    for (const [, x, y] of this.path) (xs.push(x), ys.push(y));
    const reach = Math.max(...this.about.targets.map(([x, y]) => Math.hypot(x, y))) + 0.1;
    const box = [Math.min(...xs, this.pose[0] - reach), Math.max(...xs, this.pose[0] + reach), Math.min(...ys, this.pose[1] - reach), Math.max(...ys, this.pose[1] + reach)];
    const scale = Math.min(width / (box[1] - box[0]), height / (box[3] - box[2])) * 0.92;
    const middle = [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2];
    const at = (x, y) => [width / 2 + (x - middle[0]) * scale, height / 2 - (y - middle[1]) * scale];
    return { at, scale, middle };
  }

  grid(context, { at, scale, middle }, width, height) {
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((metres) => metres * scale >= 50) ?? 100;
    const span = [width / scale / 2, height / scale / 2];
    context.strokeStyle = colour("line");
    context.lineWidth = 1;
    context.beginPath();
    for (let x = Math.ceil((middle[0] - span[0]) / step) * step; x < middle[0] + span[0]; x += step) {
      const [px] = at(x, 0);
      (context.moveTo(px, 0), context.lineTo(px, height));
    }
    for (let y = Math.ceil((middle[1] - span[1]) / step) * step; y < middle[1] + span[1]; y += step) {
      const [, py] = at(0, y);
      (context.moveTo(0, py), context.lineTo(width, py));
    }
    context.stroke();
    context.fillStyle = colour("quiet");
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(`${step} m a square`, 8, height - 8);
  }

  /** The path, and below it, broad, its part within the window. */
  lines(context, { at }) {
    const windowS = this.nowS - (this.window ? this.window[0] : 0);
    for (const [name, wide, since] of [["window", 8, windowS], ["path", 1.4, -Infinity]]) {
      context.strokeStyle = colour(name);
      context.lineWidth = wide;
      context.lineJoin = "round";
      context.beginPath();
      let before = null;
      for (const [t, x, y, joined] of this.path) {
        const here = at(x, y);
        if (t >= since && joined && before) (context.moveTo(...before), context.lineTo(...here));
        before = here;
      }
      if (before) (context.moveTo(...before), context.lineTo(...at(this.pose[0], this.pose[1])));
      context.stroke();
    }
  }

  /** Sensors side by side, as on the robot, so that each can be seen. */
  marks(context, { at }) {
    const middle = (this.about.sensors.length - 1) / 2;
    for (const [, x, y, yaw, sensor] of this.fired) {
      const [px, py] = at(x, y), aside = (sensor - middle) * 4;
      context.fillStyle = colour(`series-${sensor % 5}`);
      context.beginPath();
      context.arc(px + aside * Math.sin(yaw) + 4 * Math.cos(yaw), py + aside * Math.cos(yaw) - 4 * Math.sin(yaw), 2, 0, 7);
      context.fill();
    }
  }

  ellipse(context, { at, scale }) {
    if (!this.window) return;
    const [, , long, short, angle] = this.window;
    let times = 1;
    while (2 * long * scale * times < LEAST_ELLIPSE_PX && times < 1000 && long > 0) times *= 10;
    if (!(long > 0)) return;
    const [x, y] = at(this.pose[0], this.pose[1]), size = 2 * scale * times;
    context.strokeStyle = colour("ellipse");
    context.lineWidth = 2;
    context.beginPath();
    context.ellipse(x, y, long * size, Math.max(short * size, 1), -angle, 0, 2 * Math.PI);
    context.stroke();
    if (times === 1) return;
    context.fillStyle = colour("ellipse");
    context.textAlign = "left";
    context.fillText(`ellipse ×${times}`, x + long * size + 6, y - 8);
  }

  targets(context, { at }) {
    const [x, y, yaw] = this.pose, cos = Math.cos(yaw), sin = Math.sin(yaw), sensors = this.about.sensors.length;
    this.about.targets.forEach(([ahead, left], t) => {
      const [px, py] = at(x + cos * ahead - sin * left, y + sin * ahead + cos * left);
      let most = this.prediction ? 0 : null;
      for (let s = 0; this.prediction && s < sensors; s++) most = Math.max(most, this.prediction[t * sensors + s]);
      context.fillStyle = predicted(most);
      context.strokeStyle = colour("predicted-1");
      context.lineWidth = 0.6;
      context.beginPath();
      context.arc(px, py, 2.4, 0, 7);
      context.fill();
      context.stroke();
    });
  }

  robot(context, { at }) {
    const [x, y, yaw] = this.pose, [px, py] = at(x, y);
    context.save();
    context.translate(px, py);
    context.rotate(-yaw);
    context.fillStyle = colour("robot");
    context.beginPath();
    for (const [ahead, left] of [[9, 0], [-6, 6], [-3, 0], [-6, -6]]) context.lineTo(ahead, -left);
    context.closePath();
    context.fill();
    context.restore();
  }
}
