// A past frame, explained: which reading gave each label, when, how far off, how well that is known.

import { $, bytes, make, number, words } from "./dom.js";
import { draw, felt, predicted } from "./cells.js";

export class Explain {
  constructor() {
    this.dialog = $("explain");
    this.from = null;
    $("explain-close").addEventListener("click", () => this.close());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.dialog.open && this.close());
  }

  close() {
    this.dialog.close();
    history.replaceState(null, "", location.pathname);
    this.from?.focus();
  }

  hello(hello, plan) {
    this.about = hello;
    this.plan = plan;
    const asked = /^#frame=(\d+)$/.exec(location.hash);
    if (asked && !this.dialog.open) this.open(Number(asked[1]));
  }

  async open(key) {
    const body = $("explain-body");
    body.replaceChildren(make("p", { className: "hint" }, "Asking the learner…"));
    if (!this.dialog.open) {
      this.from = document.activeElement;
      this.dialog.show();
      $("explain-close").focus();
    }
    history.replaceState(null, "", `#frame=${key}`);
    const reply = await fetch(`/explain/${key}`).catch(() => null);
    const found = reply ? await reply.json() : { error: "the dashboard does not answer" };
    if (found.error) body.replaceChildren(make("p", {}, `Nothing to tell: ${found.error}.`));
    else this.show(body, found);
  }

  show(body, found) {
    const flat = found.labels.flat(), known = flat.filter((label) => label >= 0).length;
    const pictures = Array.from({ length: this.about.cameras }, (_, i) => make("img", { src: `/past/${found.key}/${i}`, alt: "What the camera saw" }));
    const maps = ["What was predicted", "What is known"].map((text) => Object.assign(make("canvas"), { ariaLabel: text, role: "img" }));
    const where = found.pose ? `at x ${number(found.pose[0])} m, y ${number(found.pose[1])} m, heading ${number(found.pose[2])} rad` : "but odometry does not tell where";
    body.replaceChildren(
      make("p", {}, `Taken at ${found.robot_s.toFixed(1)} s of the robot's time, ${where}. ${known} of ${flat.length} labels are known.`),
      make("div", { className: "explained" }, make("div", {}, ...pictures, ...maps), this.table(found)),
    );
    draw(maps[0], this.plan, bytes(found.prediction), predicted, true);
    draw(maps[1], this.plan, Uint8Array.from(flat, (label) => (label < 0 ? 255 : label)), felt, true);
  }

  table(found) {
    const heads = ["target", "bits, left to right", "expected", "reading", "off by", "turned", "pose known to", "weight"];
    const rows = [], values = bytes(found.prediction), sensors = this.about.sensors.length;
    for (const topic of new Set(this.about.topics)) {
      const members = this.about.topics.flatMap((name, s) => (name === topic ? [s] : []));
      this.about.targets.forEach((pose, t) => {
        const between = found.between_s[t][members[0]];
        if (between !== null) rows.push(this.row(found, pose, t, members, topic, members.map((s) => values[t * sensors + s] / 255)));
      });
    }
    if (!rows.length) return make("p", {}, "No reading has come near enough to any target so far, in place and heading, within the window.");
    const head = make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text)));
    const note = make("p", { className: "hint" }, `Sensors: ${this.about.sensors.map(words).join(", ")}. Reading: seconds after the frame, or before it (−). A ? is a sensor that said nothing. Pose known to: standard deviation of the reading's place as seen from the frame.`);
    return make("div", { className: "wide" }, make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows)), note);
  }

  row(found, [x, y, yaw], t, members, topic, expected) {
    const first = members[0], several = new Set(this.about.topics).size > 1;
    const bits = make("td", { className: "bits" }, ...members.map((s) => {
      const bit = found.labels[t][s];
      return make("b", { className: bit < 0 ? "bu" : `b${bit}` }, bit < 0 ? "?" : `${bit}`);
    }));
    const place = this.plan.line ? `${x.toFixed(2)} m` : `${x.toFixed(2)}, ${y.toFixed(2)} m${yaw ? `, ${yaw.toFixed(2)} rad` : ""}`;
    const between = found.between_s[t][first], weight = Math.max(...members.map((s) => found.weight[t][s]));
    const millimetres = (value) => (value === null ? "–" : `${(1000 * value).toFixed(1)} mm`);
    const cells = [
      expected.map((share) => `${Math.round(100 * share)}`).join(" ") + " %", `${between < 0 ? "−" : "+"}${Math.abs(between).toFixed(2)} s`,
      millimetres(found.distance_m[t][first]), `${number(found.turned_rad[t][first], 3)} rad`, millimetres(found.deviation_m[t][first]), weight.toFixed(2),
    ];
    return make("tr", {}, make("td", {}, several ? `${place} (${topic})` : place), bits, ...cells.map((text) => make("td", {}, text)));
  }
}
