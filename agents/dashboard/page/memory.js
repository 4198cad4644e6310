// What the replay buffer holds: some of its frames, and how many labels of each class it has, by target.

import { $, brush, colour, describe, make, onTheme, say, words } from "./dom.js";
import { Plan } from "./cells.js";

export class Memory {
  constructor() {
    this.told = null;
    onTheme(() => this.paint());
    new ResizeObserver(() => this.paint()).observe($("counts"));
    $("counts-legend").append(
      make("span", {}, make("i", { className: "negative" }), "labels: felt nothing"),
      make("span", {}, make("i", { className: "positive" }), "labels: felt something"),
    );
  }

  hello(hello, plan) {
    this.plan = plan ?? new Plan(hello);
    this.told = null;
  }

  update(told) {
    if (!told.memory) return;
    this.told = told.memory;
    const { frames, sizes, pictures } = told.memory;
    say($("memory-said"), frames ? `${frames} frames: the newest ${sizes.recent}, and ${sizes.memory} older ones that it chose to keep. Some of them, oldest first; a dark frame: a sensor felt something there.` : "Nothing yet: a frame is kept from its first label on.");
    const list = $("thumbnails");
    while (list.children.length > pictures.length) list.lastChild.remove();
    pictures.forEach((picture, i) => {
      if (!list.children[i]) list.append(make("li", {}, make("img")));
      const image = list.children[i].firstChild;
      if (image.dataset.id === `${picture.id}`) return;
      image.dataset.id = picture.id;
      image.src = `data:image/jpeg;base64,${picture.jpeg}`;
      image.className = picture.positive ? "felt" : "";
      image.alt = `Frame ${picture.id}: ${picture.known} labels known, ${picture.positive} of them felt something`;
      image.title = image.alt;
    });
    this.paint();
  }

  paint() {
    if (!this.told || !this.plan) return;
    const found = brush($("counts"));
    if (!found) return;
    (this.plan.line ? this.bars : this.maps).call(this, found);
    const total = this.told.counts.flat().reduce(([n, p], [negative, positive]) => [n + negative, p + positive], [0, 0]);
    describe($("counts"), `The memory's labels: ${total[0]} felt nothing, ${total[1]} felt something.`);
  }

  /** A bar each target, all its sensors together, near at the bottom. */
  bars({ context, width, height }) {
    const rows = this.told.counts.map((sensors) => sensors.reduce(([n, p], [negative, positive]) => [n + negative, p + positive], [0, 0]));
    const most = Math.max(...rows.map(([n, p]) => n + p), 1), left = 46, right = 64, top = 16;
    const up = (height - top) / rows.length, scale = (width - left - right) / most;
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.fillStyle = colour("quiet");
    context.textAlign = "left";
    context.fillText("known labels by target, all sensors", left, 7);
    const every = Math.max(1, Math.ceil(16 / up));
    rows.forEach(([negative, positive], t) => {
      const y = height - (t + 1) * up;
      context.fillStyle = colour("negative");
      context.fillRect(left, y + 0.5, (negative + positive) * scale, Math.max(up - 1, 1));
      context.fillStyle = colour("positive");
      context.fillRect(left, y + 0.5, positive * scale, Math.max(up - 1, 1));
      if (t % every) return;
      context.fillStyle = colour("quiet");
      context.textAlign = "right";
      context.fillText(`${this.plan.targets[t][0].toFixed(2)} m`, left - 6, y + up / 2);
      context.textAlign = "left";
      context.fillText(`${negative + positive}`, left + (negative + positive) * scale + 6, y + up / 2);
    });
  }

  /** From above, one map a sensor: the size of a square says how many labels are known, its dark part how many felt something. */
  maps({ context, width, height }) {
    const counts = this.told.counts, most = Math.max(...counts.flat().map(([n, p]) => n + p), 1);
    for (const [x, y, across, up, t, s] of this.plan.cells(width, height - 18)) {
      const [negative, positive] = counts[t][s], known = negative + positive, size = Math.sqrt(known / most);
      const [w, h] = [(across - 1) * size, (up - 1) * size], [left, top] = [x + (across - w) / 2, y + (up - h) / 2];
      context.fillStyle = colour("negative");
      context.fillRect(left, top, w, h);
      context.fillStyle = colour("positive");
      const part = known ? positive / known : 0;
      context.fillRect(left, top + h * (1 - part), w, h * part);
    }
    context.fillStyle = colour("quiet");
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "center";
    const across = width / this.plan.sensors.length;
    this.plan.sensors.forEach((name, s) => context.fillText(words(name), (s + 0.5) * across, height - 6));
  }
}
