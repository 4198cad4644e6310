// How it learns: three plots over robot minutes, drawn by uPlot, and the same as a table.

import { $, colour, describe, make, number, onTheme, say } from "./dom.js";

const HEIGHT = 165;

export class Curves {
  constructor() {
    this.plots = {};
    this.told = null;
    onTheme(() => this.draw(true));
    new ResizeObserver(() => this.resize()).observe($("curves"));
  }

  hello() {
    this.told = null;
    this.signature = "";
  }

  update(told) {
    if (!told.curves) return;
    this.told = told.curves;
    this.draw(false);
  }

  get minutes() {
    return this.told.minutes;
  }

  draw(anew) {
    if (!this.told || !this.minutes.length) return;
    const scored = this.minutes.find((minute) => minute.bands?.length);
    const bands = scored ? scored.bands.map(({ low_m, high_m }) => `${low_m.toFixed(2)}–${high_m.toFixed(2)} m`) : [];
    const signature = bands.join();
    if (anew || signature !== this.signature || !this.plots.auc) this.build(bands);
    this.signature = signature;
    const x = this.minutes.map((minute) => minute.end_s / 60);
    const auc = bands.flatMap((_, b) => ["low", "auc", "high"].map((what) => this.minutes.map((m) => m.bands?.[b]?.[what] ?? null)));
    this.plots.auc.setData([x, ...auc]);
    this.plots.loss.setData([x, this.minutes.map((m) => m.loss)]);
    this.plots.yield.setData([x, this.minutes.map((m) => (m.frames ? (100 * m.known) / (m.frames * this.labels) : null))]);
    this.tell(bands);
  }

  build(bands) {
    Object.values(this.plots).forEach((plot) => plot.destroy());
    const hidden = (band) => ({ stroke: "transparent", points: { show: false }, label: band });
    const shown = (band, i) => ({ label: band, stroke: colour(`series-${i % 5}`), width: 2, points: { size: 5 } });
    const series = bands.flatMap((band, i) => [hidden(`${band} low`), shown(band, i), hidden(`${band} high`)]);
    const fills = bands.map((_, i) => ({ series: [3 * i + 3, 3 * i + 1], fill: `${colour(`series-${i % 5}`)}33` }));
    const line = (name) => [{ label: name, stroke: colour("series-0"), width: 2, points: { size: 5 } }];
    const from0 = (u, low, high) => [0, high > 0 ? high * 1.1 : 1];
    this.plots = {
      auc: this.plot("auc", series, (u, low) => [Math.min(0.5, low ?? 0.5), 1], fills),
      loss: this.plot("loss", line("loss"), from0),
      yield: this.plot("yield", line("known labels"), from0),
    };
    $("curves-legend").replaceChildren(
      ...bands.map((band, i) => make("span", {}, make("i", { className: `s${i % 5}` }), band)),
      make("span", {}, make("i", { className: "drift" }), "the world changed (drift event)"),
      make("span", {}, make("i", { className: "version" }), "new weights passed the gate in this minute"),
      make("span", {}, make("i", { className: "rejected" }), "weights rejected"),
    );
  }

  plot(id, series, range, bands = []) {
    const axis = { stroke: colour("quiet"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") }, font: "11px system-ui, sans-serif" };
    return new uPlot({
      width: Math.max($(id).clientWidth, 200), height: HEIGHT, legend: { show: false }, cursor: { y: false, drag: { x: false, y: false } },
      scales: { x: { time: false, range: (u, low, high) => [0, Math.max(high ?? 1, 1)] }, y: { range } },
      axes: [{ ...axis, size: 26, values: (u, ticks) => ticks.map((tick) => `${tick}`) }, { ...axis, size: 46 }],
      series: [{ label: "robot minute" }, ...series], bands,
      hooks: { draw: [(u) => this.marks(u, id === "auc")] },
    }, [[]], $(id));
  }

  /** Drift events across; versions and rejections along the bottom of the first plot. */
  marks(u, all) {
    if (!this.told) return;
    const { ctx: pen, bbox } = u, dense = window.devicePixelRatio || 1;
    const upright = (minute, height, tint, width) => {
      const x = Math.round(u.valToPos(minute, "x", true));
      if (x < bbox.left || x > bbox.left + bbox.width) return;
      pen.fillStyle = tint;
      pen.fillRect(x, bbox.top + bbox.height - height, width * dense, height);
    };
    pen.save();
    for (const event of this.told.drift_events) upright(event.robot_s / 60, bbox.height, colour("bad"), 1.5);
    if (all) {
      for (const minute of this.minutes) {
        if (minute.published > 0) upright(minute.end_s / 60, 9 * dense, colour("quiet"), 2);
        if (minute.rejected > 0) {
          const x = u.valToPos((minute.start_s + minute.end_s) / 120, "x", true), y = bbox.top + bbox.height, size = 5 * dense;
          pen.fillStyle = colour("bad");
          pen.beginPath();
          (pen.moveTo(x, y - 1.6 * size), pen.lineTo(x - size, y), pen.lineTo(x + size, y));
          pen.fill();
        }
      }
    }
    pen.restore();
  }

  resize() {
    for (const [id, plot] of Object.entries(this.plots)) {
      const width = $(id).clientWidth;
      if (width && Math.abs(width - plot.width) > 1) plot.setSize({ width, height: HEIGHT });
    }
  }

  tell(bands) {
    const last = this.minutes.at(-1);
    const drift = this.told.drift_events.length;
    const scores = bands.map((band, b) => `${band} ${number(last.bands?.[b]?.auc)}`).join(", ");
    say($("curves-said"), `Robot minute ${(last.end_s / 60).toFixed(1)}: AUC ${scores || "not yet"}. ${drift} drift event${drift === 1 ? "" : "s"}, weights version ${last.version}.`);
    const cell = (band) => (band?.auc == null ? "–" : `${number(band.auc, 3)} [${number(band.low)} ${number(band.high)}]`);
    const head = make("tr", {}, ...["minute", ...bands, "loss", "known labels", "frames", "version", "rejected"].map((name) => make("th", { scope: "col" }, name)));
    const rows = this.minutes.map((m) => make("tr", {}, ...[
      (m.end_s / 60).toFixed(1), ...bands.map((_, b) => cell(m.bands?.[b])), number(m.loss, 3), `${m.known}`, `${m.frames}`, `${m.version}`, `${m.rejected}`,
    ].map((text) => make("td", {}, text))));
    $("curves-table").replaceChildren(make("thead", {}, head), make("tbody", {}, ...rows));
    for (const id of Object.keys(this.plots)) $(id).setAttribute("role", "img");
    describe($("auc"), `AUC by distance, last: ${scores || "none"}. The table below has all numbers.`);
    describe($("loss"), `Training loss, last: ${number(last.loss, 3)}.`);
    describe($("yield"), `Known labels in the last minute: ${last.known}.`);
  }
}
