// Frames of a while ago: the picture, what was predicted of it, and the labels as they come in.

import { $, bytes, describe, make, onTheme, say } from "./dom.js";
import { draw, felt, knownShare, predicted } from "./cells.js";

export class Film {
  /** explain(key) is called when a frame is pressed. */
  constructor(explain) {
    this.explain = explain;
    this.frames = new Map();
    onTheme(() => this.frames.forEach((frame) => this.paint(frame)));
    // What is scrolled out of sight need not be drawn, and is when it comes back.
    this.seen = new IntersectionObserver((entries) => entries.forEach((entry) => {
      const frame = this.frames.get(Number(entry.target.dataset.key));
      if (!frame) return;
      frame.visible = entry.isIntersecting;
      if (frame.visible) this.paint(frame);
    }), { root: $("film"), rootMargin: "100px" });
    $("label-legend").append(
      make("span", {}, make("i", { className: "positive" }), "felt something"),
      make("span", {}, make("i", { className: "negative" }), "felt nothing"),
      make("span", {}, make("i", { className: "unknown" }), "not known (yet)"),
    );
  }

  hello(hello, plan) {
    this.plan = plan;
    this.clear();
  }

  clear() {
    this.seen.disconnect();
    this.frames.clear();
    $("film").replaceChildren(make("li", { className: "empty" }, "Past frames come here, one every two seconds of the robot's time, as soon as there are predictions."));
  }

  update(told) {
    if (told.anew) this.clear();
    for (const past of told.past ?? []) this.take(past);
    for (const [key, frame] of this.frames)
      if (key < (told.oldest ?? 0)) {
        this.seen.unobserve(frame.item);
        frame.item.remove();
        this.frames.delete(key);
      }
    if (told.agents && told.robot_s !== undefined) this.frames.forEach((frame) => this.tell(frame, told.robot_s));
  }

  take(past) {
    let frame = this.frames.get(past.key);
    if (!frame) {
      frame = this.add(past);
      this.frames.set(past.key, frame);
      this.seen.observe(frame.item);
    }
    frame.labels = past.labels === null ? null : bytes(past.labels);
    frame.closed = past.closed;
    if (frame.visible) this.paint(frame);
  }

  add(past) {
    const film = $("film");
    film.querySelector(".empty")?.remove();
    const picture = make("img", { src: `/past/${past.key}/0`, alt: "", draggable: false });
    const maps = [make("canvas"), make("canvas")], said = make("span", { className: "said" });
    const button = make("button", { type: "button" }, picture, ...maps, said);
    button.addEventListener("click", () => this.explain(past.key));
    const item = make("li", {}, button);
    item.dataset.key = past.key;
    film.prepend(item);
    return { item, button, maps, said, robotS: past.robot_s, prediction: bytes(past.prediction), labels: null, closed: false, visible: true };
  }

  tell(frame, nowS) {
    const known = frame.labels ? Math.round(100 * knownShare(frame.labels)) : 0;
    say(frame.said, `${Math.max(nowS - frame.robotS, 0).toFixed(0)} s ago, ${known} % known${frame.closed ? ", final" : ""}`);
  }

  paint(frame) {
    draw(frame.maps[0], this.plan, frame.prediction, predicted);
    draw(frame.maps[1], this.plan, frame.labels, felt);
    frame.maps.forEach((map) => map.setAttribute("aria-hidden", "true"));
  }
}
